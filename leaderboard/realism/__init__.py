"""Whether the simulated error of an instrument is like the real one; see `simnav.realism`."""
