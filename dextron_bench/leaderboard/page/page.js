"use strict";
const table = document.getElementById("standings"), body = table.tBodies[0], rows = [...body.rows];
const controls = document.querySelector(".controls"), count = document.getElementById("count");
const wanted = (name) => controls.elements[name].value;
let order = "";

/** Whether an element is of the chosen source and split; what says nothing of one is of all. */
function chosen(element) {
  return ["reaches", "split"].every((name) => {
    const own = element.dataset[name];
    return !wanted(name) || own === undefined || own === wanted(name);
  });
}

function filter() {
  const text = wanted("text").trim().toLowerCase(), tier = wanted("tier");
  let shown = 0;
  for (const row of rows) {
    const fits = (!tier || row.dataset.tier === tier) && row.textContent.toLowerCase().includes(text);
    row.hidden = !(fits && chosen(row));
    shown += !row.hidden;
  }
  for (const section of document.querySelectorAll("main > section")) {
    const parts = [...section.querySelectorAll(":scope > [data-reaches]")];
    for (const part of parts) part.hidden = !chosen(part);
    const nothing = section.querySelector(".nothing");
    if (nothing) nothing.hidden = !parts.length || parts.some((part) => !part.hidden);
  }
  count.textContent = `${shown} of ${rows.length} rows${order}`;
  remember();
}

/** Sorts rows by a column; cells without a value come last either way. */
function sort(header, falling) {
  const place = header.cellIndex, number = header.firstElementChild.dataset.sort === "number";
  const value = (row) => row.cells[place].dataset.value;
  rows.sort((one, other) => {
    const a = value(one), b = value(other);
    if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
    return (number ? a - b : a.localeCompare(b)) * (falling ? -1 : 1);
  });
  body.append(...rows);
  for (const each of table.tHead.rows[0].cells) each.setAttribute("aria-sort", "none");
  header.setAttribute("aria-sort", falling ? "descending" : "ascending");
  order = `, by ${header.firstElementChild.textContent}, ${falling ? "descending" : "ascending"}`;
}

/** The choice is kept in the address, so that a link shows the same rows. */
function remember() {
  const kept = new URLSearchParams();
  for (const { name, value } of controls.querySelectorAll("select, input")) kept.set(name, value);
  history.replaceState(null, "", `#${kept}`);
}

function recall() {
  const kept = new URLSearchParams(location.hash.slice(1));
  for (const [name, value] of kept) {
    const control = controls.elements[name];
    if (control instanceof HTMLInputElement || [...(control?.options ?? [])].some((each) => each.value === value))
      control.value = value;
  }
}

for (const button of table.tHead.querySelectorAll("button")) {
  const header = button.parentElement;
  button.addEventListener("click", () => {
    const now = header.getAttribute("aria-sort"), first = button.dataset.sort === "number" && button.textContent !== "rank";
    sort(header, now === "none" ? first : now === "ascending");
    filter();
  });
}
controls.addEventListener("input", filter);
controls.addEventListener("submit", (event) => event.preventDefault());
controls.hidden = false;
recall();
filter();
