"""What authors of plug-ins, and the project's own tests, check their work with."""
