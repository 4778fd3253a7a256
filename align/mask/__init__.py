"""The object's mask, from the whole stack."""
