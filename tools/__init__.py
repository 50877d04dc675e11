"""Scripts for those who work on tsdyn itself."""
