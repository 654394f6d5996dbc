// The menus that all pages share: scenarios and estimators, by name, with their pages.
"use strict";
for (const [name, entries] of Object.entries($MENUS)) {
  const list = document.querySelector(`[data-menu=${name}] > div`), here = decodeURIComponent(location.pathname.split("/").pop());
  for (const [text, page] of entries) {
    const link = document.createElement("a");
    link.textContent = text;
    link.href = page;
    if (page === here) link.setAttribute("aria-current", "page");
    list.append(link);
  }
}
