"""What a campaign contains, and parameters followed through many campaigns."""
