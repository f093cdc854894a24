"""A ride in physics: rider control model, contact forces, the log and the true pose."""
