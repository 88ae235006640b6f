"use strict";
const table = document.getElementById("standings"), body = table.tBodies[0], rows = [...body.rows];
const controls = document.querySelector(".controls"), count = document.getElementById("count");
const choice = (name) => controls.elements[name].value;
let order = "";

/** True if an element belongs to the chosen source and split; an element without one belongs to all. */
function isChosen(element) {
  return ["reaches", "split"].every((name) => {
    const value = element.dataset[name];
    return !choice(name) || value === undefined || value === choice(name);
  });
}

/** Fades the right edge of each part that can be scrolled further to the right. */
function markEdges() {
  for (const part of document.querySelectorAll(".scroll"))
    part.classList.toggle("more", part.scrollLeft + part.clientWidth < part.scrollWidth - 1);
}

function filter() {
  const text = choice("text").trim().toLowerCase(), tier = choice("tier");
  let shown = 0, quoted = 0;
  for (const row of rows) {
    const matches = (!tier || row.dataset.tier === tier) && row.textContent.toLowerCase().includes(text);
    row.hidden = !(matches && isChosen(row));
    if (row.dataset.tier === "quoted") quoted += !row.hidden;
    else shown += !row.hidden;
  }
  for (const section of document.querySelectorAll("main > section")) {
    const parts = [...section.querySelectorAll(":scope > [data-reaches]")];
    for (const part of parts) part.hidden = !isChosen(part);
    const nothing = section.querySelector(".nothing");
    if (nothing) nothing.hidden = !parts.length || parts.some((part) => !part.hidden);
  }
  const all = rows.filter((row) => row.dataset.tier !== "quoted").length;
  count.textContent = `${shown} of ${all} rows${quoted ? `, ${quoted} quoted` : ""}${order}`;
  markEdges();
  saveChoice();
}

/** Sorts rows by a column; cells without a value come last in both orders. */
function sort(header, descending) {
  const column = header.cellIndex, number = header.firstElementChild.dataset.sort === "number";
  const value = (row) => row.cells[column].dataset.value;
  rows.sort((one, other) => {
    const a = value(one), b = value(other);
    if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
    return (number ? a - b : a.localeCompare(b)) * (descending ? -1 : 1);
  });
  body.append(...rows);
  for (const cell of table.tHead.rows[0].cells) cell.setAttribute("aria-sort", "none");
  header.setAttribute("aria-sort", descending ? "descending" : "ascending");
  order = `, by ${header.firstElementChild.textContent}, ${descending ? "descending" : "ascending"}`;
}

/** Keeps the choice in the address, so that a link shows the same rows. */
function saveChoice() {
  const parameters = new URLSearchParams();
  for (const { name, value } of controls.querySelectorAll("select, input")) parameters.set(name, value);
  history.replaceState(null, "", `#${parameters}`);
}

function restoreChoice() {
  const parameters = new URLSearchParams(location.hash.slice(1));
  for (const [name, value] of parameters) {
    const control = controls.elements[name];
    if (control instanceof HTMLInputElement || [...(control?.options ?? [])].some((option) => option.value === value))
      control.value = value;
  }
}

for (const button of table.tHead.querySelectorAll("button")) {
  const header = button.parentElement;
  button.addEventListener("click", () => {
    const current = header.getAttribute("aria-sort"), descendingFirst = button.dataset.sort === "number";
    sort(header, current === "none" ? descendingFirst : current === "ascending");
    filter();
  });
}
for (const part of document.querySelectorAll(".scroll")) part.addEventListener("scroll", markEdges, { passive: true });
addEventListener("resize", markEdges);
controls.addEventListener("input", filter);
controls.addEventListener("submit", (event) => event.preventDefault());
controls.hidden = false;
restoreChoice();
filter();
