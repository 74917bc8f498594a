"""The dashboard: a live page of hulls. It uses the public client only."""
