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

  /**
   * Two-sided p-value of the mean over the groups of the mean difference, by random flips of the signs.
   *
   * Where the rows do not differ, each difference is as likely as its negative. All flips are taken where there are few
   * runs; otherwise 4999, and the flip that was observed counts too, so that the p-value is never zero.
   */
  simnav.signflips = (groups, weights = groups.map(() => 1), flips = 4999) => {
    const values = [], factors = [], total = weights.reduce((a, b) => a + b, 0);
    groups.forEach((group, k) => group.forEach((d) => { values.push(d); factors.push(weights[k] / total / group.length); }));
    const terms = values.map((v, i) => v * factors[i]), n = terms.length;
    if (!n) return null;
    const observed = Math.abs(terms.reduce((a, b) => a + b, 0)) * (1 - 1e-12);
    let beyond = 0;
    if (n <= 13) {
      for (let mask = 0; mask < 2 ** n; mask++) {
        let sum = 0;
        for (let i = 0; i < n; i++) sum += mask & (1 << i) ? terms[i] : -terms[i];
        if (Math.abs(sum) >= observed) beyond++;
      }
      return beyond / 2 ** n;
    }
    const random = bits(20250101);
    for (let k = 0; k < flips; k++) {
      let sum = 0, word = 0;
      for (let i = 0; i < n; i++) {
        if (i % 32 === 0) word = random();
        sum += word & 1 ? terms[i] : -terms[i];
        word >>>= 1;
      }
      if (Math.abs(sum) >= observed) beyond++;
    }
    return (beyond + 1) / (flips + 1);
  };

  /** What a comparison says, by scenario and over all. */
  simnav.comparison = (a, b) => {
    const pairs = simnav.pairs(a, b);
    const rows = pairs.map(({ scenario, runs }) => {
      const differences = runs.map((r) => r.difference);
      return {
        scenario, runs: runs.length, wins: runs.filter((r) => r.difference < 0).length / runs.length,
        ratio: Math.exp(mean(differences)), p: simnav.signflips([differences]), differences, list: runs,
      };
    });
    const overall = rows.length && {
      runs: rows.reduce((s, r) => s + r.runs, 0),
      ratio: Math.exp(mean(rows.map((r) => Math.log(r.ratio)))),
      better: rows.filter((r) => r.ratio < 1).length,
      p: simnav.signflips(rows.map((r) => r.differences)),
    };
    return { rows, overall };
  };

  /** Scores of the rows with weights of the scenarios; a row without one of those that count has none. */
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
