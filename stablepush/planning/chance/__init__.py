"""How likely a plan is to succeed: scenarios, success on them, and plans that are to hold in most."""
