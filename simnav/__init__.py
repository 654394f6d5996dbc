"""simnav: the open benchmark for marine integrated navigation."""
