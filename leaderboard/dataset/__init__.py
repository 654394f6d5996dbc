"""Data sets for learning: recordings of the random voyages of a training family, in splits, as Parquet or as a stream.

`splits` has the seeds of the splits, `voyages` makes the recordings, `schemas` and `tables` are their form in files,
`parts` writes and reads some of them, `manifest` says what a folder holds, `card` describes it to people, and `making`
writes a whole folder.
"""
