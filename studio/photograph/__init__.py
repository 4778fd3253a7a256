"""A photograph large in the browser, with balls outlined on it: what a review and a new session both need."""
