"""Claims of papers, and the conditions under which they hold: ``simnav paper claim``.

A claim says that one method is better than another by so much. Papers do not print all of their settings. So the
question is not only whether a claim holds with the settings that we chose, but which unprinted choice makes it hold.

- `claim`: what a claim is: two methods, a score, the printed gain, and the choices (dials) that are varied.
- `dials`: dials of common kinds: the delay of an output, a parameter, another row, a value of a scenario.
- `declared`: the claims of the five papers.
- `search`: varies one dial at a time on seeds of a search, and judges what it found on other seeds.
- `points`: the gain at each value, with intervals; `answer`: the sentence that says when a claim holds.
- `stored`: the answers that come with simnav; `documentation` puts them on the pages of the papers.
- `gain_figure`: gain against the value of a dial, with the claim as a line.
"""
