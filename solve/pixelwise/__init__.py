"""Methods that look at one pixel at a time; one file a method."""
