"""What a trip does to fences."""
