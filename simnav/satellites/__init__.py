"""Satellites of GPS, Galileo and BeiDou: broadcast ephemerides, orbits, the atmosphere, receiver clocks and signals."""
