"""Text of the page of a report: layout and the script that sorts, filters and draws."""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>%%title%%</title>
<style>
body { font: 15px/1.45 system-ui, sans-serif; margin: 0 auto; max-width: 1500px; padding: 1rem 1.5rem; color: #1c1c1c; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; }
h2 { font-size: 1.15rem; margin-top: 2.4rem; border-top: 1px solid #ddd; padding-top: 1rem; }
nav { columns: 16rem 3; margin: 1rem 0; }
nav a { display: block; color: #1f5f99; text-decoration: none; }
.tools { position: sticky; top: 0; background: #fffffff2; padding: .5rem 0; z-index: 5; border-bottom: 1px solid #ddd; }
.tools label { margin-right: .8rem; white-space: nowrap; }
#filter { width: 20rem; }
.dot { display: inline-block; width: .7em; height: .7em; border-radius: 50%; margin-right: .35em; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .87rem; }
th:focus-visible, summary:focus-visible, a:focus-visible { outline: 2px solid #0072b2; outline-offset: -2px; }
th { cursor: pointer; text-align: right; padding: .3rem .55rem; border-bottom: 2px solid #999; white-space: nowrap; }
th[data-order]::after { content: " ▲"; } th[data-order="down"]::after { content: " ▼"; }
td { text-align: right; padding: .2rem .55rem; border-bottom: 1px solid #eee; white-space: nowrap; }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
th:first-child, td:first-child { position: sticky; left: 0; background: #fff; }
tbody tr:hover, tbody tr:hover td { background: #f2f6fa; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem; font-size: .87rem; }
dt { color: #666; } dd { margin: 0; }
summary { cursor: pointer; margin: .6rem 0; color: #1f5f99; }
</style>
</head>
<body>
<h1>%%title%%</h1>
<nav aria-label="Sections"></nav>
<div class="tools"><label>Filter <input id="filter" type="search" placeholder="name of an estimator"></label>
<span id="kinds"></span></div>
<main></main>
<h2 id="provenance">Provenance</h2>
<dl>%%about%%</dl>
<script id="data" type="application/json">%%data%%</script>
<script>%%plotly%%</script>
<script>
const data = JSON.parse(document.getElementById("data").textContent);
const make = (tag, parent, text, attributes = {}) => {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  Object.assign(element, attributes);
  if (parent) parent.appendChild(element);
  return element;
};
const shown = value => value === null || value === undefined ? "–" : typeof value !== "number" ? value :
  Number.isInteger(value) ? String(value) : Math.abs(value) >= 1000 ? value.toFixed(0) : value.toPrecision(3);
const hidden = new Set();
const rows = [];

function drawTable(parent, table, title) {
  const scroll = make("div", parent, null, {className: "scroll"});
  const element = make("table", scroll);
  scroll.tabIndex = 0;
  element.setAttribute("aria-label", title);
  const head = make("tr", make("thead", element));
  const body = make("tbody", element);
  const kind = table.columns.indexOf("kind"), name = table.columns.indexOf("estimator");
  const numeric = table.columns.map((_, column) => table.rows.some(row => typeof row[column] === "number"));
  for (const cells of table.rows) {
    const row = make("tr", body);
    row.cells_ = cells;
    cells.forEach((cell, column) => {
      const td = make("td", row, null, {className: numeric[column] ? "" : "text"});
      if (column === name && kind >= 0) {
        const dot = make("span", td, null, {className: "dot"});
        dot.style.background = data.colours[cells[kind]] || data.colours["–"];
      }
      td.append(shown(cell));
    });
    rows.push({element: row, name: name >= 0 ? String(cells[name]) : null, kind: kind >= 0 ? cells[kind] : null});
  }
  table.columns.forEach((column, index) => {
    const th = make("th", head, column, {className: numeric[index] ? "" : "text", title: data.foot[column] || "",
      scope: "col", tabIndex: 0});
    th.onkeydown = event => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      th.onclick();
    };
    th.onclick = () => {
      const down = th.dataset.order === "up";
      head.querySelectorAll("th").forEach(other => { delete other.dataset.order; other.removeAttribute("aria-sort"); });
      th.dataset.order = down ? "down" : "up";
      th.setAttribute("aria-sort", down ? "descending" : "ascending");
      const missing = down ? -Infinity : Infinity;
      const key = row => {
        const cell = row.cells_[index], number = Number.parseFloat(cell);  // of an interval, its lower end
        return cell === null ? missing : Number.isNaN(number) ? cell : number;
      };
      const sorted = [...body.rows].sort((a, b) => typeof key(a) === "number" && typeof key(b) === "number" ?
        key(a) - key(b) : String(key(a)).localeCompare(String(key(b))));
      if (down) sorted.reverse();
      body.append(...sorted);
    };
  });
}

let isShown = name => true;
const drawn = [];

function applyFilter() {
  const words = document.getElementById("filter").value.toLowerCase().split(/\\s+/).filter(Boolean);
  const matches = name => !words.length || words.some(word => name.toLowerCase().includes(word));
  const kindOf = Object.fromEntries(rows.filter(row => row.kind).map(row => [row.name, row.kind]));
  isShown = name => matches(name) && !hidden.has(kindOf[name]);
  for (const row of rows) if (row.name !== null) row.element.hidden = !matches(row.name) || hidden.has(row.kind);
  drawn.forEach(draw => draw());
}

// The traces of a plot with only those estimators that are shown: lines are named, marks and cells have names as y.
function filtered(plot) {
  const named = plot.data.filter(trace => !trace.name || isShown(trace.name));
  return named.map((trace, rank) => {
    if (trace.name) return {...trace, visible: rank < 5 ? true : "legendonly"};
    const kept = trace.y.map((name, index) => isShown(name) ? index : -1).filter(index => index >= 0);
    const pick = values => kept.map(index => values[index]);
    if (trace.z) return {...trace, x: pick(trace.x), y: pick(trace.y), z: pick(trace.z).map(pick)};
    const error = trace.error_x;
    return {...trace, x: pick(trace.x), y: pick(trace.y), marker: {...trace.marker, color: pick(trace.marker.color)},
      error_x: {...error, array: pick(error.array), arrayminus: pick(error.arrayminus)}};
  });
}

const main = document.querySelector("main"), nav = document.querySelector("nav");
const pending = [];
data.sections.forEach((section, number) => {
  make("h2", main, section.title, {id: "section-" + number});
  make("a", nav, section.title, {href: "#section-" + number});
  section.tables.forEach(table => drawTable(main, table, section.title));
  section.plots.forEach((plot, index) => {
    const details = make("details", main, null, {open: index === 0});
    make("summary", details, plot.layout.title);
    const place = make("div", details);
    const draw = () => {
      const traces = filtered(plot), lacking = plot.row ? plot.data[0].y.length - traces[0].y.length : 0;
      Plotly.react(place, traces, {...plot.layout, title: undefined, margin: {l: 10, r: 10, t: 10, b: 40},
        height: plot.layout.height - plot.row * lacking,
        xaxis: {automargin: true, ...plot.layout.xaxis}, yaxis: {automargin: true, ...plot.layout.yaxis},
        showlegend: plot.data.length > 1, font: {family: "system-ui, sans-serif"}}, {responsive: true});
    };
    const open = () => {
      if (!details.open || drawn.includes(draw)) return;
      drawn.push(draw);
      draw();
    };
    details.addEventListener("toggle", open);
    pending.push(open);
  });
});
make("a", nav, "Provenance", {href: "#provenance"});
const kinds = document.getElementById("kinds");
[...new Set(rows.map(row => row.kind))].filter(Boolean).forEach(kind => {
  const label = make("label", kinds);
  const box = make("input", label, null, {type: "checkbox", checked: true});
  const dot = make("span", label, null, {className: "dot"});
  dot.style.background = data.colours[kind] || data.colours["–"];
  label.append(kind === "–" ? "other" : kind);
  box.onchange = () => { box.checked ? hidden.delete(kind) : hidden.add(kind); applyFilter(); };
});
document.getElementById("filter").oninput = applyFilter;
pending.forEach(open => open());
</script>
</body>
</html>
"""
"""``%%name%%`` marks where a part goes."""
