"""Compiled loops of pushing: friction on the table, contact laws, one and two contacts, the rollout of a push."""
