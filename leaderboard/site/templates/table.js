// Tables: sorted, searched, filtered, with a choice of columns, kept in the address, and exported as CSV and LaTeX.
"use strict";
{
  const { make, write, state } = simnav;

  /** What a cell is sorted by: a number, a text, or nothing. */
  const key = (column, row) => {
    const value = row[column.key];
    if (value === null || value === undefined || value === "") return null;
    if (typeof value === "object") return "sort" in value ? value.sort : value.value ?? value.text ?? null;
    return value;
  };

  const swatch = (row) => row.light && make("span", { class: "swatch", "aria-hidden": "true", style: { "--light": row.light, "--dark": row.dark ?? row.light } });

  /** The text of a cell, for export and search. */
  const text = (column, row) => {
    const value = row[column.key];
    if (column.kind === "interval") return value && value.low !== null ? `${write.ratio(value.low)} – ${write.ratio(value.high)}` : write.text(null);
    if (value !== null && typeof value === "object") return value.text ?? (write[column.kind] ?? write.text)(value.value);
    return (write[column.kind] ?? write.text)(value);
  };

  /** A value with its interval on the logarithmic scale of the column. */
  const bar = (column, row) => {
    const value = row[column.key], scale = column.scale;
    if (!value || !(value.value > 0) || !scale) return write.text(null);
    const place = (x) => Math.min(100, Math.max(0, 2 + (96 * Math.log(x / scale.low)) / Math.log(scale.high / scale.low)));
    const children = [make("b", { class: value.value > scale.high ? "beyond" : null, style: { left: `${place(value.value)}%` } })];
    if (value.low > 0) children.unshift(make("i", { style: { left: `${place(value.low)}%`, width: `${Math.max(0.5, place(value.high) - place(value.low))}%` } }));
    const words = `${write.ratio(value.value)}, 95 % interval ${write.ratio(value.low)} to ${write.ratio(value.high)}`;
    return make("div", { class: "bar", role: "img", "aria-label": words, "data-help": words, style: { "--light": row.light ?? "#66707d", "--dark": row.dark ?? "#9aa5b1" } }, children);
  };

  /** A share as a bar from 0 to 1, with a line where 95 % would be. */
  const share = (value) => make("div", { class: "share" }, make("i", { style: { width: `${Math.min(100, Math.max(0, 100 * value))}%` } }), make("b"), make("span", {}, write.share(value)));

  const content = (column, row) => {
    const value = row[column.key];
    if (column.kind === "bar") return bar(column, row);
    if (column.kind === "share" && typeof value === "number") return share(value);
    if (column.kind === "badge") return value ? make("span", { class: `badge ${String(value).split(" ")[0]}` }, String(value)) : write.text(null);
    const words = text(column, row);
    const link = value !== null && typeof value === "object" ? value.page : null;
    const parts = [link ? make("a", { href: link }, words) : words];
    if (value !== null && typeof value === "object" && value.note) parts.push(" ", make("small", {}, value.note));
    return parts;
  };

  class Table {
    constructor(host, given) {
      Object.assign(this, { host, given, name: given.name, words: "", chosen: {}, order: null });
      const param = (what) => (this.name === "main" ? what : `${this.name}.${what}`);
      this.param = param;
      this.columns = given.columns.map((column) => ({ ...column, shown: !column.hidden }));
      const kept = state.get(param("cols"));
      if (kept === null && innerWidth < 640) for (const c of this.columns) if (c.wide) c.shown = false;
      if (kept !== null) for (const c of this.columns) c.shown = c.fixed || kept.split(",").includes(c.key);
      this.words = state.get(param("q")) ?? "";
      for (const c of this.filters()) this.chosen[c.key] = state.get(param(c.key)) ?? "";
      const sort = state.get(param("sort")) ?? given.sort ?? "";
      if (sort) this.order = { key: sort.replace(/^-/, ""), down: sort.startsWith("-") };
      this.build();
      this.draw();
    }

    filters() { return this.columns.filter((c) => c.filter); }

    build() {
      const { given, param } = this;
      this.body = make("tbody");
      this.head = make("tr");
      this.status = make("span", { class: "count", role: "status" });
      const tools = make("div", { class: "tools" });
      if (given.rows.length > 4 || given.search) {
        const field = make("input", { type: "search", "aria-label": `Search in ${given.title}`, placeholder: "Search", value: this.words });
        field.addEventListener("input", () => { this.words = field.value; state.set(param("q"), field.value); this.draw(); });
        tools.append(field);
      }
      for (const column of this.filters()) {
        const values = [...new Set(given.rows.map((row) => row[column.key]).filter(Boolean))].sort();
        if (values.length < 2) continue;
        const select = make("select", { "aria-label": `Only ${column.title}` }, make("option", { value: "" }, `${column.title}: all`), values.map((v) => make("option", { value: v, selected: v === this.chosen[column.key] }, v)));
        select.addEventListener("change", () => { this.chosen[column.key] = select.value; state.set(param(column.key), select.value); this.draw(); });
        tools.append(select);
      }
      if (this.columns.length > 4) {
        const boxes = this.columns.filter((c) => !c.fixed).map((column) => {
          const box = make("input", { type: "checkbox", checked: column.shown });
          box.addEventListener("change", () => {
            column.shown = box.checked;
            state.set(param("cols"), this.columns.filter((c) => c.shown).map((c) => c.key).join(","));
            this.draw();
          });
          return make("label", { "data-help": column.help }, box, ` ${column.title}`);
        });
        tools.append(make("details", { class: "columns" }, make("summary", {}, "Columns"), make("div", {}, boxes)));
      }
      const file = (kind, label) => make("button", { type: "button", class: "plain", onclick: () => this.save(kind) }, label);
      tools.append(this.status, file("csv", "CSV"), file("tex", "LaTeX"));
      this.table = make("table", { "aria-label": given.title }, make("thead", {}, this.head), this.body);
      const scroll = make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": given.title }, this.table);
      this.host.replaceChildren(tools, scroll);
    }

    visible() { return this.columns.filter((c) => c.shown); }

    rows() {
      const words = this.words.toLowerCase().split(/\s+/).filter(Boolean);
      let rows = this.given.rows.filter((row) => this.filters().every((c) => !this.chosen[c.key] || row[c.key] === this.chosen[c.key]));
      if (words.length) {
        rows = rows.filter((row) => {
          const all = this.columns.filter((c) => ["name", "text", "badge"].includes(c.kind)).map((c) => text(c, row)).join(" ").toLowerCase() + (row.words ?? "").toLowerCase();
          return words.every((word) => all.includes(word));
        });
      }
      const column = this.order && this.columns.find((c) => c.key === this.order.key);
      if (!column) return rows;
      const sign = this.order.down ? -1 : 1;
      return [...rows].sort((a, b) => {
        const [x, y] = [key(column, a), key(column, b)];
        if (x === null || y === null) return (x === null) - (y === null);
        return sign * (typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y)));
      });
    }

    sort(column) {
      const down = this.order?.key === column.key ? !this.order.down : Boolean(column.descending);
      this.order = { key: column.key, down };
      state.set(this.param("sort"), (down ? "-" : "") + column.key);
      this.draw();
    }

    heading(column) {
      const sorted = this.order?.key === column.key ? (this.order.down ? "descending" : "ascending") : null;
      const button = make("button", { type: "button", "data-help": column.help, onclick: () => { this.sort(column); this.head.querySelector(`[data-key="${column.key}"] button`)?.focus(); } }, column.title);
      return make("th", { scope: "col", "data-key": column.key, "aria-sort": sorted, class: this.classes(column) }, button);
    }

    classes(column) {
      const right = ["number", "integer", "percent", "share", "duration", "size", "ratio", "p"].includes(column.kind);
      return [right ? "n" : "", column.kind === "name" ? "name" : "", column.kind === "words" ? "wrap" : ""].join(" ").trim() || null;
    }

    draw() {
      const columns = this.visible(), rows = this.rows();
      this.head.replaceChildren(...columns.map((c) => this.heading(c)));
      this.body.replaceChildren(...rows.map((row) => {
        const classes = [row.reference && "reference", row.mark, row.best && "may-be-best"];
        const line = make("tr", { class: classes.filter(Boolean).join(" ") || null });
        for (const column of columns) {
          const value = row[column.key];
          const best = value !== null && typeof value === "object" && value.best;
          const help = value !== null && typeof value === "object" ? value.help : null;
          const cell = column.kind === "name"
            ? make("th", { scope: "row", class: "name" }, swatch(row), content(column, row))
            : make("td", { class: [this.classes(column), best && "best"].filter(Boolean).join(" ") || null, "data-help": help }, content(column, row));
          line.append(cell);
        }
        if (this.given.onrow) this.given.onrow(line, row);
        return line;
      }));
      const all = this.given.rows.length;
      this.status.textContent = rows.length === all ? `${all} rows` : `${rows.length} of ${all} rows`;
    }

    /** The table as it is shown, as CSV with full digits or as LaTeX (booktabs). */
    text(kind) {
      const columns = this.visible(), rows = this.rows();
      if (kind === "csv") {
        // A text that a spreadsheet would compute gets an apostrophe; a number is none.
        const inert = (x) => (/^[=+\-@\t\r]/.test(x) && Number.isNaN(Number(x)) ? `'${x}` : x);
        const quote = (x) => ((y) => (/[",\n\r]/.test(y) ? `"${y.replaceAll('"', '""')}"` : y))(inert(x));
        const cell = (c, row) => {
          const value = row[c.key], plain = value !== null && typeof value === "object" ? value.value ?? value.text : value;
          return quote(plain === null || plain === undefined ? (c.kind === "interval" ? text(c, row) : "") : String(plain));
        };
        return [columns.map((c) => quote(c.title)).join(","), ...rows.map((row) => columns.map((c) => cell(c, row)).join(","))].join("\n") + "\n";
      }
      const signs = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "–": "--", "×": "$\\times$", "µ": "$\\mu$", "∞": "$\\infty$", "<": "$<$", ">": "$>$" };
      const escape = (x) => x.replace(/[\\~^–×µ∞<>]|[&%$#_{}]/g, (c) => signs[c] ?? `\\${c}`);
      const drawn = columns.filter((c) => c.kind !== "bar");
      const align = drawn.map((c) => ((this.classes(c) ?? "").includes("n ") || this.classes(c) === "n" ? "r" : "l")).join("");
      const line = (cells) => `${cells.map(escape).join(" & ")} \\\\`;
      return [`% ${this.given.title}; ${simnav.page.citation ?? ""}`, `\\begin{tabular}{${align}}`, "\\toprule", line(drawn.map((c) => c.title)), "\\midrule", ...rows.map((row) => line(drawn.map((c) => text(c, row)))), "\\bottomrule", "\\end{tabular}"].join("\n") + "\n";
    }

    save(kind) {
      const address = URL.createObjectURL(new Blob([this.text(kind)], { type: kind === "csv" ? "text/csv" : "text/x-tex" }));
      const title = this.given.title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "");
      make("a", { href: address, download: `${title}.${kind}` }).click();
      setTimeout(() => URL.revokeObjectURL(address), 1000);
    }
  }

  simnav.tables = {};
  simnav.table = (host, given) => (simnav.tables[given.name] = new Table(host, given));
}
