// What each kind of page does with its data.
"use strict";
(async () => {
  const { make, state, write } = simnav, page = (simnav.page = await simnav.read(document.body.dataset.page));
  const at = (name, within = document) => within.querySelector(`[data-${name}]`);
  const say = (host, text) => host.replaceChildren(make("p", { class: "note" }, text));

  // -- the board ------------------------------------------------------------------------------------

  const drawn = new Set();

  const drawTrack = (track) => {
    if (drawn.has(track.key)) return;
    drawn.add(track.key);
    const panel = document.getElementById(`track-${track.key}`);
    simnav.table(at("table", panel), track.table);
    if (track.map) simnav.chart(at("map", panel), track.map);
    const charts = at("charts", panel);
    for (const chart of track.charts) simnav.chart(charts, chart);
    if (!track.charts.length) charts.closest("section").remove();
    const weights = at("weights", panel);
    if (weights) drawWeights(weights, track);
  };

  const drawWeights = (host, track) => {
    const kept = (state.get(`${track.key}.weights`) ?? "").split(",");
    const weights = Object.fromEntries(track.kinds.map((s, i) => [s.id, kept[i] === undefined || kept[i] === "" ? 1 : Math.max(0, Number(kept[i]) || 0)]));
    const even = Object.fromEntries(track.kinds.map((s) => [s.id, 1]));
    const before = simnav.places(simnav.weighted(track.ratios, even));
    const fields = make("div", { class: "weights" }), table = make("div");
    const draw = () => {
      const scores = simnav.weighted(track.ratios, weights), places = simnav.places(scores);
      const without = track.kinds.map((s) => simnav.places(simnav.weighted(track.ratios, { ...even, [s.id]: 0 })));
      const rows = Object.keys(track.ratios).map((row) => {
        const range = without.map((w) => w[row]).filter((x) => x !== null), moved = before[row] - places[row];
        return {
          name: row, place: places[row], score: scores[row],
          moved: { value: moved, text: moved > 0 ? `▲ ${moved}` : moved < 0 ? `▼ ${-moved}` : "=" },
          without: range.length ? { sort: Math.min(...range), text: Math.min(...range) === Math.max(...range) ? `${range[0]}` : `${Math.min(...range)}–${Math.max(...range)}` } : null,
        };
      });
      simnav.table(table, {
        name: `${track.key}.weighted`, title: `${track.title}: places with these weights`, sort: "place", rows,
        columns: [
          { key: "place", title: "Place", help: "With these weights.", kind: "integer" },
          { key: "name", title: "Estimator", help: "Only estimators with a result in every kind that counts have a place.", kind: "name", fixed: true },
          { key: "score", title: "Score", help: "Weighted geometric mean of the scores by kind of trouble.", kind: "ratio" },
          { key: "moved", title: "Moved", help: "Places gained or lost against equal weights.", kind: "text" },
          { key: "without", title: "Without one kind", help: "Places when any one kind of trouble is left out, all others counting the same.", kind: "text" },
        ],
      });
    };
    for (const s of track.kinds) {
      const field = make("input", { type: "number", min: "0", max: "10", step: "0.5", value: weights[s.id], "data-kind": s.id });
      field.addEventListener("input", () => {
        weights[s.id] = Math.max(0, Number(field.value) || 0);
        const changed = track.kinds.some((t) => weights[t.id] !== 1);
        state.set(`${track.key}.weights`, changed ? track.kinds.map((t) => weights[t.id]).join(",") : "");
        draw();
      });
      fields.append(make("label", { "data-help": s.title }, field, ` ${s.name}`));
    }
    host.append(fields, table);
    draw();
  };

  const tracks = () => {
    simnav.shown.rows = [];
    const tabs = [...document.querySelectorAll("[role=tab]")], select = at("tracks"); // the second on a phone
    if (!tabs.length) return page.tracks.forEach(drawTrack);
    const show = (tab, focus) => {
      select.value = tab.dataset.track;
      for (const other of tabs) {
        const chosen = other === tab;
        other.setAttribute("aria-selected", chosen);
        other.tabIndex = chosen ? 0 : -1;
        document.getElementById(other.getAttribute("aria-controls")).hidden = !chosen;
      }
      if (focus) tab.focus();
      drawTrack(page.tracks.find((t) => t.key === tab.dataset.track));
    };
    tabs.forEach((tab, k) => {
      tab.addEventListener("click", () => { state.set("track", tab.dataset.track); show(tab); });
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        const next = tabs[(k + step + tabs.length) % tabs.length];
        state.set("track", next.dataset.track);
        show(next, true);
      });
    });
    select.addEventListener("change", () => {
      state.set("track", select.value);
      show(tabs.find((t) => t.dataset.track === select.value));
    });
    show(tabs.find((t) => t.dataset.track === state.get("track")) ?? tabs[0]);
  };

  // -- the first page --------------------------------------------------------------------------------

  /** Three boxes, and what the stored results say for them. */
  const index = () => {
    const host = at("advisor");
    if (!host) return;
    const { answers, troubles, limits, milliseconds, commands } = page.advisor;
    const box = (key, label, options) => {
      const kept = state.get(key), select = make("select", {}, options.map(([value, text]) => make("option", { value, selected: value === kept }, text)));
      select.addEventListener("change", () => { state.set(key, select.value); show(); });
      host.append(make("label", {}, `${label} `, select));
      return select;
    };
    const kit = box("instruments", "Instruments", Object.keys(answers).map((title) => [title, title]));
    const trouble = box("trouble", "What may go wrong", Object.entries(troubles));
    const limit = box("time", "Time of an epoch", limits.map((text, k) => [String(k), text]));
    const show = () => {
      const [first, ...rest] = answers[kit.value][trouble.value][Number(limit.value)], time = milliseconds[Number(limit.value)];
      const code = (text) => text.split("`").map((part, k) => (k % 2 ? make("code", {}, part) : part));
      const command = `simnav recommend ${commands[kit.value].replaceAll(",", " ")}${trouble.value ? ` --trouble ${trouble.value}` : ""}${time === null ? "" : ` --milliseconds ${time}`}`;
      at("answer").replaceChildren(make("p", { class: "verdict" }, code(first)), make("ul", { class: "plain" }, rest.map((text) => make("li", {}, code(text)))), make("pre", { tabindex: "0" }, make("code", {}, command)));
    };
    show();
  };

  // -- a scenario -------------------------------------------------------------------------------------

  const scenario = () => {
    if (page.drawn.length) simnav.rowswitch(at("rows"), page.drawn, page.first);
    else simnav.shown.rows = page.first;
    simnav.table(at("table"), page.table);
    const host = at("charts");
    for (const chart of page.charts) simnav.chart(host, chart);
    if (page.inside.length) {
      const charts = make("div", { class: "charts" });
      host.after(make("details", {}, make("summary", {}, "Weights of the measurements"), charts));
      for (const chart of page.inside) simnav.chart(charts, chart);
    }
    document.querySelectorAll("[data-sweep]").forEach((place, k) => explore(place, page.sweeps[k]));
    oneRun(at("run"));
  };

  /** A sweep: its charts, and a slider over the values of its dial. Rows without a result here cannot be switched. */
  const explore = (place, { charts, values, rows, dial }) => {
    const drawn = charts.map((chart) => simnav.chart(place, { ...chart, always: rows }));
    if (values.length < 2) return;
    const curves = charts[0].data.curves.rows, last = values.length - 1;
    const slider = make("input", { type: "range", min: "0", max: String(last), step: "1", value: String(last), "aria-label": dial.title, "data-slider": true });
    const said = make("output");
    const show = () => {
      const k = Number(slider.value), words = `${values[k]}${dial.unit ? ` ${dial.unit}` : ""}`;
      said.textContent = words;
      slider.setAttribute("aria-valuetext", words);
      const steps = rows.map((row) => ({ row, ...Object.fromEntries(["middle", "low", "high", "failed"].map((n) => [n, curves[row]?.[n][curves[row].value.indexOf(values[k])] ?? null])) }));
      drawn[0].show({ data: { ...charts[0].data, at: { value: [values[k]] } } });
      drawn[1].show({ data: { steps } });
    };
    slider.addEventListener("input", show);
    place.before(make("p", { class: "tools slider" }, make("label", {}, `${dial.title[0].toUpperCase()}${dial.title.slice(1)} `, slider), said));
    show();
  };

  const oneRun = (host) => {
    const { argument } = page.scenario, rows = Object.keys(page.rows);
    if (!rows.length) return say(host, "No estimator ran here.");
    let row = state.get("row"), seed = Number(state.get("seed") ?? page.runs.seeds[0]);
    if (!rows.includes(row)) row = page.first[0];
    const choice = make("select", { "aria-label": "Estimator" }, rows.map((r) => make("option", { value: r, selected: r === row }, r)));
    const runs = make("select", { "aria-label": "Run" }, page.runs.all.map((s) => make("option", { value: s, selected: s === seed }, `seed ${s}${page.runs.seeds.includes(s) ? " (with track and errors)" : ""}`)));
    const facts = make("p", { class: "note", role: "status" }), command = make("code"), list = make("div"), charts = make("div", { class: "charts" });
    const drawn = make("details", { class: "drawn" }), inner = make("div", { class: "charts" });
    const inside = make("details", { class: "inside" }, make("summary", {}, "Innovations, residuals and weights of this run"), inner);
    host.append(make("div", { class: "tools" }, make("label", {}, "Estimator ", choice), make("label", {}, "Run ", runs)), facts, make("pre", { tabindex: "0" }, command), drawn, charts, inside, make("details", {}, make("summary", {}, "All runs of this estimator"), list));
    let made = null, within = null;
    const showInside = () => {
      if (!inside.open || !page.runs.seeds.includes(seed)) return;
      const read = page.runs.data[seed].inside;
      if (!within) within = page.runs.inside.map((chart) => simnav.chart(inner, { ...chart, data: read[chart.name] ?? {} }));
      else for (const chart of within) chart.show({ data: read[chart.given.name] ?? {} });
    };
    inside.addEventListener("toggle", showInside);
    const show = async () => {
      state.set("row", row);
      state.set("seed", String(seed));
      runs.value = String(seed);
      command.textContent = `simnav run ${argument} --seed ${seed} -e ${row} --plot run.svg`;
      const all = (await simnav.read(page.rows[row].data)).runs.scenarios[page.scenario.id];
      drawRuns(list, all);
      const k = all.seed.indexOf(seed);
      facts.textContent = k < 0 ? `${row} did not run with seed ${seed}.` : `${row}, seed ${seed}${all.note?.[k] ? `, ${all.note[k]}` : ""}: ${all.status?.[k] ?? "ok"}${all.reason?.[k] ? ` (${all.reason[k]})` : ""}, horizontal RMSE ${write.number(all.scores.horizontal_rmse?.[k])} m, ${write.duration(all.seconds[k])}.`;
      charts.hidden = drawn.hidden = !page.runs.seeds.includes(seed);
      inside.hidden = charts.hidden || !page.runs.inside.length;
      if (charts.hidden) return;
      const read = page.runs.data[seed];
      drawn.hidden = !read.draws.length;
      const values = read.draws.map(([key, value]) => make("tr", {}, make("th", { scope: "row" }, key), make("td", { class: "wrap" }, value)));
      drawn.replaceChildren(make("summary", {}, `Drawn for this run: ${read.draws.length} values`), make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Drawn for this run" }, make("table", {}, make("tbody", {}, values))));
      const shown = (name) => { // three standard deviations are those of the estimator that is chosen
        const { bounds, ...given } = read.charts[name];
        return bounds?.[row] ? { ...given, bound: bounds[row] } : given;
      };
      if (!made) made = page.runs.charts.map((chart) => simnav.chart(charts, { ...chart, data: shown(chart.name) }));
      else for (const chart of made) chart.show({ data: shown(chart.given.name) });
      showInside();
    };
    const drawRuns = (target, all) => {
      const columns = page.table.columns.filter((c) => all.scores[c.key]).map((c) => ({ ...c, hidden: false }));
      simnav.table(target, {
        name: "runs", title: `Runs of ${row}`, sort: "seed",
        columns: [{ key: "seed", title: "Seed", help: "Choose a run to see it above.", kind: "name", fixed: true }, { key: "status", title: "Status", help: "How the run ended.", kind: "text", filter: true }, ...columns],
        rows: all.seed.map((s, k) => ({ seed: { text: String(s), value: s, sort: s }, run: s, status: all.status?.[k] ?? "ok", ...Object.fromEntries(columns.map((c) => [c.key, all.scores[c.key][k]])) })),
        onrow: (line, item) => {
          const cell = line.querySelector("th");
          cell.replaceChildren(make("button", { type: "button", class: "link", onclick: () => { seed = item.run; show(); host.scrollIntoView(); } }, String(item.run)));
        },
      });
    };
    choice.addEventListener("change", () => {
      row = choice.value;
      if (!simnav.shown.rows.includes(row)) simnav.shown.set([...simnav.shown.rows, row]);
      show();
    });
    runs.addEventListener("change", () => { seed = Number(runs.value); show(); });
    new IntersectionObserver((entries, observer) => {
      if (!entries.some((e) => e.isIntersecting)) return;
      observer.disconnect();
      show();
    }, { rootMargin: "200px" }).observe(host);
  };

  // -- an estimator -----------------------------------------------------------------------------------

  const comparisonTable = (found, a, b, name) => ({
    name, title: `${a} against ${b}`, sort: "ratio",
    columns: [
      { key: "name", title: "Scenario", help: "The name leads to the page of the scenario.", kind: "name", fixed: true },
      { key: "ratio", title: `Error of ${a} / ${b}`, help: `Geometric mean over the runs of the error of ${a} divided by that of ${b}. Below 1, ${a} is better.`, kind: "number" },
      { key: "wins", title: "Runs won", help: `Share of the runs in which the error of ${a} is the smaller one.`, kind: "percent", descending: true },
      { key: "p", title: "p-value", help: "Two-sided, by a studentised bootstrap of the paired differences of the log error. Six runs or more are needed.", kind: "p" },
      { key: "runs", title: "Runs", help: "Runs that both have.", kind: "integer" },
      { key: "verdict", title: "Verdict", help: "At the 5 % level, without correction for the number of scenarios.", kind: "badge", filter: true },
    ],
    rows: found.rows.map((r) => ({
      ...r, name: { text: r.entry.name, page: r.entry.page },
      verdict: r.p !== null && r.p < 0.05 ? (r.ratio < 1 ? "better" : "worse") : "no difference",
    })),
  });

  const compared = async (a, b) => {
    const [mine, other] = (await Promise.all([simnav.read(a), simnav.read(b)])).map((row) => row.errors);
    const found = simnav.comparison(mine, other);
    for (const row of found.rows) row.entry = mine.scenarios[row.scenario];
    return found;
  };

  const verdict = (found, a, b) => {
    if (!found.overall) return `${a} and ${b} have no run in common.`;
    const { ratio, p, runs, better } = found.overall, count = found.rows.length, level = write.p(p);
    const words = ratio < 1 ? `${write.number(100 * (1 - ratio))} % smaller` : `${write.number(100 * (ratio - 1))} % larger`;
    return `Over ${count} scenarios and ${runs} runs the error of ${a} is ${words} than that of ${b} (p ${level.startsWith("<") ? level : `= ${level}`}). ${a} is better on ${better} of ${count} scenarios.`;
  };

  const estimator = () => {
    simnav.shown.rows = page.first;
    simnav.table(at("table"), page.table);
    const host = at("charts");
    for (const chart of page.charts) simnav.chart(host, chart);
    if (!page.charts.length) host.closest("section").remove();
    for (const chart of page.worst?.charts ?? []) simnav.chart(at("worst"), chart);
    if (page.losses?.shown) simnav.table(at("losses"), page.losses.table);
    const beside = at("compare");
    if (beside) {
      compared(page.data, page.plain.data).then((found) => {
        const table = make("div");
        beside.replaceChildren(make("p", { class: "verdict" }, verdict(found, page.label, page.plain.label)), table);
        if (found.rows.length) simnav.table(table, comparisonTable(found, page.label, page.plain.label, "plain"));
      });
    }
  };

  // -- two rows -----------------------------------------------------------------------------------------

  const compare = () => {
    const rows = Object.keys(page.rows), host = at("choice");
    let [a, b] = [state.get("a"), state.get("b")];
    if (!(a in page.rows)) a = rows[0];
    if (!(b in page.rows)) b = rows.find((r) => r === "ekf" && r !== a) ?? rows.find((r) => r !== a) ?? a;
    const field = (label, value, change) => {
      const select = make("select", { "aria-label": label }, rows.map((r) => make("option", { value: r, selected: r === value }, r)));
      select.addEventListener("change", () => change(select.value));
      return select;
    };
    const first = field("First estimator", a, (v) => { a = v; show(); }), second = field("Second estimator", b, (v) => { b = v; show(); });
    const swap = make("button", { type: "button", onclick: () => { [a, b] = [b, a]; first.value = a; second.value = b; show(); } }, "Swap");
    host.append(first, " against ", second, swap);
    simnav.shown.rows = [];
    let chart = null;
    const show = async () => {
      state.set("a", a);
      state.set("b", b);
      const found = await compared(page.rows[a].data, page.rows[b].data);
      at("verdict").textContent = verdict(found, a, b);
      if (!found.rows.length) {
        say(at("table"), "There is nothing to compare.");
        at("runs").replaceChildren();
        at("charts").hidden = true;
        return;
      }
      simnav.table(at("table"), comparisonTable(found, a, b, "main"));
      at("charts").hidden = false;
      const all = found.rows.flatMap((r) => r.list.map((run) => ({ ...run, scenario: r.entry.name, entry: r.entry, ratio: Math.exp(run.difference) })));
      const data = { runs: all.map(({ run, scenario, ratio }) => ({ run, scenario, ratio })), means: found.rows.map((r) => ({ scenario: r.entry.name, ratio: r.ratio })) };
      const x = { field: "ratio", type: "quantitative", title: `Error of ${a} / error of ${b}`, scale: { type: "log", nice: false } };
      const y = { field: "scenario", type: "nominal", title: null };
      const spec = {
        height: { step: 24 },
        layer: [
          { data: { values: [{ one: 1 }] }, mark: { type: "rule", color: "$grey", strokeDash: [3, 3] }, encoding: { x: { field: "one", type: "quantitative" } } },
          { data: { name: "runs" }, mark: { type: "tick", opacity: 0.55, color: "$strong" }, encoding: { x, y, tooltip: [{ field: "scenario", title: "Scenario" }, { field: "run", title: "Run" }, { field: "ratio", title: "Ratio", format: ".3~g" }] } },
          { data: { name: "means" }, mark: { type: "point", filled: true, size: 60, color: "$ink", opacity: 1 }, encoding: { x, y, tooltip: [{ field: "scenario", title: "Scenario" }, { field: "ratio", title: "Geometric mean", format: ".3~g" }] } },
        ],
      };
      const given = { name: "pairs", title: "Paired ratios", caption: `Ticks: runs. Points: geometric means. To the left of 1, ${a} has the smaller error.`, spec, data };
      if (chart) chart.show(given);
      else chart = simnav.chart(at("charts"), given);
      simnav.table(at("runs"), {
        name: "byrun", title: `${a} against ${b}, run by run`, sort: "ratio", search: true,
        columns: [
          { key: "scenario", title: "Scenario", help: "Where both ran.", kind: "name", fixed: true, filter: true },
          { key: "run", title: "Run", help: "Seed, or recording.", kind: "text" },
          { key: "a", title: a, help: `Error of ${a}, as a multiple of the reference figure.`, kind: "ratio" },
          { key: "b", title: b, help: `Error of ${b}, as a multiple of the reference figure.`, kind: "ratio" },
          { key: "ratio", title: "Ratio", help: `Below 1, ${a} has the smaller error.`, kind: "number" },
          { key: "command", title: "Command", help: "Repeats the run.", kind: "text", hidden: true },
        ],
        rows: all.map((r) => ({ ...r, command: `simnav run ${r.entry.argument} --seed ${r.run} -e ${a},${b}` })),
      });
    };
    show();
    addEventListener("hashchange", () => { // a cell of the matrix of wins
      const [x, y] = [state.get("a"), state.get("b")];
      if (!(x in page.rows) || !(y in page.rows) || (x === a && y === b)) return;
      [a, b] = [x, y];
      [first.value, second.value] = [a, b];
      show();
      host.scrollIntoView();
    });
    const tracks = at("tracks");
    if (tracks) drawWins(tracks, at("wins"));
  };

  /** The matrix of wins of the track that is chosen. */
  const drawWins = (host, place) => {
    const keys = page.wins.map((t) => t.key);
    let key = keys.includes(state.get("track")) ? state.get("track") : keys[0], chart = null;
    const select = make("select", { "aria-label": "Track" }, page.wins.map((t) => make("option", { value: t.key, selected: t.key === key }, t.title)));
    const draw = () => {
      const given = page.wins.find((t) => t.key === key).chart, { row, other } = given.data.cells;
      given.data.cells.page = row.map((a, k) => `compare.html#${new URLSearchParams({ track: key, a, b: other[k] })}`);
      if (chart) chart.show(given);
      else chart = simnav.chart(place, { ...given });
    };
    select.addEventListener("change", () => {
      key = select.value;
      state.set("track", key);
      draw();
    });
    host.append(make("label", {}, "Track ", select));
    draw();
  };

  const kinds = { index, tracks, scenario, estimator, compare, about: () => {} };
  at("print")?.addEventListener("click", () => simnav.print());
  await kinds[page.kind]?.();
  document.body.dataset.ready = "true";
})();
