// Sorting: a click on a heading sorts up, a second one down, a third restores the order.
const NEXT = {none: "ascending", ascending: "descending", descending: "none"};

function sortValue(cell) {
  const text = cell.dataset.value ?? cell.textContent.trim();
  return {text: text === "–" ? "" : text, number: text === "" ? NaN : Number(text)};
}

function compare(a, b, sign) {  // what has no value comes last, whichever the direction
  const one = sortValue(a), other = sortValue(b);
  if (one.text === "" || other.text === "") return (one.text === "") - (other.text === "");
  const both = !Number.isNaN(one.number) && !Number.isNaN(other.number);
  return sign * (both ? one.number - other.number : one.text.localeCompare(other.text, "en", {numeric: true}));
}

for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0], order = [...body.rows], heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.querySelector(".sort").addEventListener("click", () => {
      const direction = NEXT[head.getAttribute("aria-sort")];
      for (const other of heads) other.setAttribute("aria-sort", other === head ? direction : "none");
      const sign = direction === "ascending" ? 1 : -1;
      const rows = direction === "none" ? order : [...order].sort((a, b) => compare(a.cells[column], b.cells[column], sign));
      body.append(...rows);
    });
  });
}
