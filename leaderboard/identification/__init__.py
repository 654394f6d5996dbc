"""``simnav log identify``: the error model of a log by maximum likelihood of a filter's innovations.

- `assumption`: what is assumed of a log, and the numbers that are varied
- `innovations`: the innovations of the plain filter for an assumption
- `scoring`: the maximum of their likelihood
- `choices`, `search`: what is fitted, and in which order
- `prediction`: positions after a minute without fixes, and the errors that are enlarged for them
- `estimates`, `remarks`: the figures for the scenario file, and what the log does not tell
- `report`: all of it
"""
