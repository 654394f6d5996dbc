// Charts: Vega-Lite specifications from the page's data, drawn when they come into view, in the colours of the theme.
"use strict";
{
  const { make, state } = simnav;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const { palettes, inks, dashes } = $APPEARANCE; // written by the site, see figures/appearance.py

  let printing = false;
  const theme = () => (dark.matches && !printing ? "dark" : "light");

  const config = (name) => {
    const { ink, grey, grid } = inks[name];
    return {
      background: null, font: "system-ui, sans-serif", view: { stroke: null }, mark: { color: palettes[name][0] },
      axis: { labelColor: ink, titleColor: ink, tickColor: grey, domainColor: grey, gridColor: grid, labelFontSize: 11, titleFontSize: 12, titleFontWeight: 500, labelOverlap: true, labelSeparation: 6 },
      legend: { labelColor: ink, titleColor: ink, orient: "bottom" }, header: { labelColor: ink, titleColor: ink }, title: { color: ink },
    };
  };

  /** The rows that all charts of the page show: kept in the address. */
  const shown = {
    rows: null,
    listeners: [],
    set(rows) {
      this.rows = rows;
      state.set("rows", rows.join("|"));
      for (const listener of this.listeners) listener();
    },
  };
  simnav.shown = shown;

  const style = (row, rows = shown.rows) => {
    const ranked = rows.filter((r) => !simnav.page.rows?.[r]?.reference), place = ranked.indexOf(row);
    if (place < 0) return { colour: inks[theme()].grey, dash: dashes[1 + (rows.filter((r) => !ranked.includes(r)).indexOf(row) % 3)] };
    return { colour: palettes[theme()][place % 8], dash: dashes[Math.floor(place / 8) % 4] };
  };

  /** Columns, or curves by row, become a list of objects. */
  const expand = (data, rows) => {
    if (Array.isArray(data)) return data;
    if (!data.rows) {
      const names = Object.keys(data);
      return (data[names[0]] ?? []).map((_, i) => Object.fromEntries(names.map((n) => [n, data[n][i]])));
    }
    const found = [];
    for (const row of rows) {
      const curves = data.rows[row];
      if (!curves) continue;
      const names = Object.keys(curves), axis = data.axis;
      const length = curves[names[0]].length;
      for (let i = 0; i < length; i++) {
        const item = axis ? { row, [data.name]: axis[i] } : { row };
        for (const n of names) item[n] = curves[n][i];
        found.push(item);
      }
    }
    return found;
  };

  /** Put what depends on the theme and on the rows into a specification; a legend where no switches name the rows. */
  const fill = (item, rows, legend) => {
    const { ink, grey, grid, shade } = inks[theme()];
    const words = { $ink: ink, $grey: grey, $grid: grid, $shade: shade, $strong: palettes[theme()][0], $second: palettes[theme()][1], $scheme: theme() === "dark" ? "tealblues" : "blues" };
    const scales = {
      $colours: () => ({ domain: rows, range: rows.map((r) => style(r, rows).colour) }),
      $banded: () => rows.slice(0, 3),
      $dashes: () => ({ domain: rows, range: rows.map((r) => style(r, rows).dash) }),
    };
    if (typeof item === "string") return item in words ? words[item] : item in scales ? scales[item]() : item;
    if (Array.isArray(item)) return item.map((v) => fill(v, rows, legend));
    if (item && typeof item === "object") {
      const found = Object.fromEntries(Object.entries(item).map(([k, v]) => [k, fill(v, rows, legend)]));
      if (legend && typeof item.scale === "string") found.legend = { title: null, orient: "bottom", columns: 3 };
      return found;
    }
    return item;
  };

  /** One scale on both axes: metres are as long to the east as to the north. */
  const equal = (spec, frame, width) => {
    let [x, y] = [frame.x, frame.y].map(([a, b]) => [a - 0.06 * (b - a) - 1e-9, b + 0.06 * (b - a) + 1e-9]);
    const widen = ([a, b], span) => [(a + b - span) / 2, (a + b + span) / 2];
    const height = Math.max(240, Math.min(560, (width * (y[1] - y[0])) / (x[1] - x[0])));
    const metres = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height);
    [x, y] = [widen(x, metres * width), widen(y, metres * height)];
    Object.assign(spec, { width, height });
    spec.encoding.x.scale = { ...spec.encoding.x.scale, domain: x, nice: false, zero: false };
    spec.encoding.y.scale = { ...spec.encoding.y.scale, domain: y, nice: false, zero: false };
  };

  class Chart {
    constructor(host, given) {
      Object.assign(this, { host, given });
      this.place = make("div", { class: "vega", role: "group", "aria-label": given.title });
      host.append(make("figure", { class: given.wide ? "chart wide" : "chart", id: `chart-${given.name}` }, make("h3", {}, given.title), this.place, make("figcaption", {}, given.caption ?? "")));
      this.drawn = false;
      simnav.drawings.add(this);
      new IntersectionObserver((entries, observer) => {
        if (!entries.some((e) => e.isIntersecting)) return;
        observer.disconnect();
        this.draw();
      }, { rootMargin: "300px" }).observe(this.place);
      const again = () => { if (this.drawn) this.draw(); };
      if (given.byrow) shown.listeners.push(again);
      dark.addEventListener("change", again);
    }

    async draw() {
      this.drawn = true;
      await simnav.load("vega.js");
      const { given } = this, { data } = given;
      const rows = given.always ?? shown.rows ?? [];
      const spec = fill(given.spec, rows, Boolean(given.always));
      const width = Math.max(180, this.place.clientWidth - 75);
      spec.$schema = "https://vega.github.io/schema/vega-lite/v6.json";
      if (spec.facet) { // panels side by side, as many as fit
        const fit = Math.max(1, Math.min(spec.columns, Math.floor((width + 75) / 230))), count = Math.max(1, rows.length);
        spec.columns = Math.ceil(count / Math.ceil(count / fit));
        const side = Math.min(300, Math.floor((width + 30) / spec.columns) - 30);
        Object.assign(spec.spec, { width: side, height: side });
      } else spec.width ??= width;
      spec.datasets = Object.fromEntries(Object.entries(data).map(([name, d]) => [name, expand(d, rows)]));
      // A layer without data would only spoil the scales.
      if (spec.layer) spec.layer = spec.layer.filter((l) => !l.data?.name || spec.datasets[l.data.name]?.length);
      const empty = data.curves && !spec.facet && !spec.datasets.curves?.length && !data.truth;
      const none = Boolean(empty || (spec.layer && !spec.layer.length));
      this.place.classList.toggle("none", none);
      if (none) return this.place.replaceChildren("Curves of these rows are not kept.");
      if (given.equal) equal(spec, data.frame, width);
      delete spec.datasets.frame;
      this.view?.finalize();
      const found = await vegaEmbed(this.place, spec, {
        renderer: "svg", config: config(theme()), tooltip: { theme: theme() }, downloadFileName: `simnav-${given.name}`,
        actions: { export: { svg: true, png: true }, source: false, compiled: false, editor: false },
      });
      this.view = found.view;
      this.place.querySelector("summary")?.setAttribute("aria-label", `Save ${given.title} as SVG or PNG`);
      this.place.dataset.drawn = "true";
    }

    /** Show another set of data, of the same kind. */
    show(changes) {
      Object.assign(this.given, changes);
      if (this.drawn) this.draw();
    }
  }

  /** Draw the charts that were not in view yet, all in the colours of paper, and print the page. */
  simnav.print = async () => {
    const redraw = (paper) => {
      printing = paper;
      simnav.switches?.();
      return Promise.all([...simnav.drawings].filter((c) => c.place.offsetParent && (dark.matches || !c.drawn)).map((c) => c.draw()));
    };
    await redraw(true);
    print();
    await redraw(false);
  };
  addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key !== "p") return;
    event.preventDefault();
    simnav.print();
  });

  simnav.charts = {};
  simnav.drawings = new Set();
  simnav.chart = (host, given) => (simnav.charts[given.name] = new Chart(host, given));

  /** Switches of the rows that are drawn: those shown as buttons, the others in a list. */
  simnav.rowswitch = (host, rows, first) => {
    const kept = state.get("rows")?.split("|").filter((r) => rows.includes(r));
    shown.rows = kept?.length ? kept : first;
    const draw = () => {
      const chips = shown.rows.map((row) => {
        const { colour, dash } = style(row);
        const line = make("span", { class: "line", "aria-hidden": "true", style: { "border-top": `3px ${dash[1] ? "dashed" : "solid"} ${colour}` } });
        return make("button", { type: "button", class: "chip", "data-row": row, "data-help": `Hide ${row}`, onclick: () => shown.set(shown.rows.filter((r) => r !== row)) }, line, row, make("span", { "aria-hidden": "true" }, " ×"));
      });
      const others = rows.filter((r) => !shown.rows.includes(r));
      const select = make("select", { "aria-label": "Show another row" }, make("option", { value: "" }, `Show another row (${others.length})`), others.map((r) => make("option", { value: r }, r)));
      select.addEventListener("change", () => { if (select.value) shown.set([...shown.rows, select.value]); });
      host.replaceChildren(...chips, others.length ? select : "");
    };
    simnav.switches = draw;
    shown.listeners.push(draw);
    dark.addEventListener("change", draw);
    draw();
  };
}
