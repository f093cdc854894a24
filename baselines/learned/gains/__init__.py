"""Networks that set the gains of a filter while it runs."""
