"""The same four-bar in other programs; data.py has its numbers."""
