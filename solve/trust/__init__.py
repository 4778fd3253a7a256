"""What each answer is worth where no truth is known."""
