// Two rows against each other, run by run: paired differences, and how likely they are where the rows do not differ.
"use strict";
{
  const mean = (x) => x.reduce((a, b) => a + b, 0) / x.length;

  /** A generator of random bits with a seed (mulberry32), so that a page gives the same figures every time. */
  const bits = (seed) => () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return (t ^ (t >>> 14)) >>> 0;
  };

  /** Paired differences of the logarithm of the error, a minus b, by scenario: [{scenario, runs: [{run, a, b, difference}]}]. */
  simnav.pairs = (a, b) => {
    const found = [];
    for (const scenario of Object.keys(a.scenarios)) {
      const other = b.scenarios[scenario], mine = a.scenarios[scenario];
      if (!other) continue;
      const at = new Map(other.run.map((run, i) => [run, other.error[i]]));
      const runs = [];
      mine.run.forEach((run, i) => {
        const [x, y] = [mine.error[i], at.get(run)];
        if (x === null || y === null || y === undefined) return;
        runs.push({ run, a: x, b: y, difference: Math.log(Math.max(x, 1e-12)) - Math.log(Math.max(y, 1e-12)) });
      });
      if (runs.length) found.push({ scenario, runs });
    }
    return found;
  };

  /** The mean of a sample, and the sum of the squares of its residuals. */
  const moments = (x) => {
    const centre = mean(x);
    return [centre, x.reduce((sum, v) => sum + (v - centre) ** 2, 0)];
  };
  const FEWEST = 6, RELEVANT = Math.log(1.001), LEAST_VARIANCE = 0.01, FEWEST_VISIBLE = 2;

  /**
   * Two-sided p-value of the mean over the scenarios of the mean difference, by a studentised bootstrap of the runs of a
   * seed together. As on the board, the difference has to hold with one more run that is unlucky for the better row, and
   * a difference of less than 0.1 % is none. Null with fewer than six seeds, because then nothing is significant.
   */
  simnav.pvalue = (scenarios, draws = 4999) => {
    const shares = new Map();
    for (const { runs } of scenarios) {
      for (const { run, difference } of runs) shares.set(run, (shares.get(run) || 0) + difference / (scenarios.length * runs.length));
    }
    const n = shares.size, values = [...shares.values()].map((v) => v * n);
    if (n < FEWEST) return null;
    const [centre, square] = moments(values), residuals = values.map((v) => v - centre);
    const distance = Math.max(Math.abs(centre) - RELEVANT, 0), least = 0.5 ** (n - 1);
    if (distance === 0) return 1;
    const largest = Math.max(...residuals.map(Math.abs));
    const visible = square ** 2 >= FEWEST_VISIBLE * residuals.reduce((sum, r) => sum + r ** 4, 0);
    const unlucky = visible ? 0.5 * largest : largest; // of two rows, each has half of the difference
    const studentised = (d, sum, count) => d * Math.sqrt((count * (count - 1)) / sum);
    const more = Math.max((n * distance - unlucky) / (n + 1), 0);
    const observed = Math.min(
      studentised(distance, square, n),
      studentised(more, square + ((distance + unlucky) ** 2 * n) / (n + 1), n + 1),
    );
    const random = bits(20250101);
    let beyond = 1; // what was observed counts, so that the p-value is never zero
    for (let k = 0; k < draws; k++) {
      let sum = 0, squares = 0;
      for (let i = 0; i < n; i++) {
        const r = residuals[Math.floor((random() / 2 ** 32) * n)];
        sum += r;
        squares += r * r;
      }
      const variance = Math.max(squares / n - (sum / n) ** 2, (LEAST_VARIANCE * square) / n);
      if (variance > 0 && Math.abs(sum / n) * Math.sqrt((n - 1) / variance) >= observed * (1 - 1e-9)) beyond++;
    }
    return Math.max(beyond / (draws + 1), least);
  };

  /** What a comparison says, by scenario and over all. */
  simnav.comparison = (a, b) => {
    const pairs = simnav.pairs(a, b);
    const rows = pairs.map(({ scenario, runs }) => {
      const differences = runs.map((r) => r.difference);
      return {
        scenario, runs: runs.length, wins: runs.filter((r) => r.difference < 0).length / runs.length,
        ratio: Math.exp(mean(differences)), p: simnav.pvalue([{ runs }]), differences, list: runs,
      };
    });
    const overall = rows.length && {
      runs: rows.reduce((s, r) => s + r.runs, 0),
      ratio: Math.exp(mean(rows.map((r) => Math.log(r.ratio)))),
      better: rows.filter((r) => r.ratio < 1).length,
      p: simnav.pvalue(pairs),
    };
    return { rows, overall };
  };

  /** Scores of the rows with weights of the kinds of trouble; a row without one of those that count has none. */
  simnav.weighted = (ratios, weights) => {
    const counted = Object.keys(weights).filter((s) => weights[s] > 0), total = counted.reduce((t, s) => t + weights[s], 0);
    const found = {};
    for (const [row, by] of Object.entries(ratios)) {
      const whole = total > 0 && counted.every((s) => typeof by[s] === "number");
      found[row] = whole ? Math.exp(counted.reduce((t, s) => t + weights[s] * Math.log(by[s]), 0) / total) : null;
    }
    return found;
  };

  /** Places by score; equal scores share one. */
  simnav.places = (scores) => {
    const values = Object.values(scores).filter((s) => s !== null);
    return Object.fromEntries(Object.entries(scores).map(([row, s]) => [row, s === null ? null : 1 + values.filter((v) => v < s).length]));
  };
}
