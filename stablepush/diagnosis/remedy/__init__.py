"""What follows: the corrected rig, and the pushes that tell causes apart."""
