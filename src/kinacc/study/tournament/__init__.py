"""Every assessor on every error field: who keeps what it says, and how close it comes."""
