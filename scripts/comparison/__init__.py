"""Parts of ``poise benchmark``."""
