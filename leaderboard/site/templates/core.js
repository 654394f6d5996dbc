// What all pages share: their data, how values are written, the state in the address, help on hover and focus.
"use strict";
const simnav = (window.simnav = { packed: {}, page: {} });

// -- elements -------------------------------------------------------------------------------------

/** Make an element. Texts become text nodes, so that nothing in the data is ever read as HTML. */
simnav.make = (name, attributes = {}, ...children) => {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style" && typeof value === "object") for (const [k, v] of Object.entries(value)) element.style.setProperty(k, v);
    else element.setAttribute(key, value === true ? "" : value);
  }
  for (const child of children.flat()) if (child !== null && child !== undefined) element.append(child);
  return element;
};

/** Load a script of the site once: files from disk cannot be fetched. */
const scripts = new Map();
simnav.load = (file) => {
  if (!scripts.has(file)) {
    scripts.set(file, new Promise((resolve, reject) => {
      const script = simnav.make("script", { src: file });
      script.onload = resolve;
      script.onerror = () => reject(new Error(`${file} cannot be read`));
      document.head.append(script);
    }));
  }
  return scripts.get(file);
};

/** What stands in data/NAME.js: JSON, compressed and written as text, one file a page. */
const contents = new Map();
const unpacked = async (name) => {
  if (!(name in simnav.packed)) await simnav.load(`data/${name}.js`);
  const bytes = Uint8Array.from(atob(simnav.packed[name]), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
};
simnav.read = (name) => {
  if (!contents.has(name)) contents.set(name, unpacked(name));
  return contents.get(name);
};

// -- values -----------------------------------------------------------------------------------------

const missing = "–";
const known = (x) => typeof x === "number" && Number.isFinite(x);

/** Three significant digits, without an exponent where it can be avoided. */
simnav.number = (x, digits = 3) => {
  if (x === Infinity) return "∞";
  if (!known(x)) return missing;
  if (x === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(Number(x.toExponential(digits - 1)))));
  if (exponent >= 6 || exponent < -4) return x.toExponential(digits - 1);
  return exponent >= digits ? String(Number(x.toPrecision(digits))) : x.toFixed(Math.max(digits - 1 - exponent, 0));
};
simnav.duration = (s) => {
  if (!known(s)) return missing;
  for (const [factor, unit] of [[1e-6, "µs"], [1e-3, "ms"], [1, "s"]]) if (s < 999.5 * factor) return `${simnav.number(s / factor)} ${unit}`;
  return s < 7200 ? `${simnav.number(s / 60)} min` : `${simnav.number(s / 3600)} h`;
};
simnav.size = (bytes) => {
  if (!known(bytes) || bytes === 0) return missing;
  for (const [factor, unit] of [[2 ** 30, "GiB"], [2 ** 20, "MiB"], [2 ** 10, "KiB"]]) if (bytes >= factor) return `${simnav.number(bytes / factor)} ${unit}`;
  return `${bytes} B`;
};
simnav.write = {
  number: simnav.number,
  integer: (x) => (known(x) ? String(x) : missing),
  share: (x) => (known(x) ? `${(100 * x).toFixed(1)} %` : missing),
  percent: (x) => (known(x) ? `${(100 * x).toFixed(1)} %` : missing),
  duration: simnav.duration,
  size: simnav.size,
  ratio: (x) => (known(x) && x >= 0.999 * simnav.page.failure ? "failed" : simnav.number(x)),
  p: (x) => (!known(x) ? missing : x < 0.001 ? "< 0.001" : x.toFixed(3)),
  text: (x) => (x === null || x === undefined || x === "" ? missing : String(x)),
};
simnav.write.words = simnav.write.text;

// -- the state in the address -------------------------------------------------------------------------

simnav.state = {
  get: (key) => new URLSearchParams(location.hash.slice(1)).get(key),
  /** Keep a value in the address; an empty one is left out. */
  set: (key, value) => {
    const all = new URLSearchParams(location.hash.slice(1));
    if (value === null || value === undefined || value === "") all.delete(key);
    else all.set(key, value);
    const text = all.toString();
    history.replaceState(null, "", text ? `#${text}` : location.pathname + location.search);
  },
};

// -- help ---------------------------------------------------------------------------------------------

/** What an element's data-help says is shown while the pointer is on it, or while it has the focus. */
{
  let tip = null;
  const hide = () => { if (tip) tip.hidden = true; };
  const show = (event) => {
    const target = event.target.closest?.("[data-help]");
    if (!target) return hide();
    if (!tip) {
      tip = simnav.make("div", { id: "tip", role: "tooltip" });
      document.body.append(tip);
    }
    tip.textContent = target.dataset.help;
    tip.hidden = false;
    const at = target.getBoundingClientRect(), own = tip.getBoundingClientRect();
    const left = Math.max(8, Math.min(at.left, document.documentElement.clientWidth - own.width - 8));
    const below = at.bottom + 6 + own.height < innerHeight;
    tip.style.left = `${left}px`;
    tip.style.top = `${below ? at.bottom + 6 : Math.max(4, at.top - own.height - 6)}px`;
  };
  document.addEventListener("mouseover", show);
  document.addEventListener("focusin", show);
  document.addEventListener("focusout", hide);
  document.addEventListener("scroll", hide, true);
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") hide(); });
}
