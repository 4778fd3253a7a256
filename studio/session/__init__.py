"""A session in the browser: begun from photographs, or looked at in its output folder; and put right."""
