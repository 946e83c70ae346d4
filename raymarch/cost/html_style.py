"""Style sheet and table script of the report; both are embedded in its single file."""

STYLE = """
:root { color-scheme: light dark; --ink: #1d2127; --soft: #5c6570; --paper: #fff; --card: #f5f6f8; --line: #dde1e6;
  --good: #1a7f4b; --bad: #c0182f; --front: #e6f4ec; --mark: #1a7f4b; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e7eb; --soft: #9aa4b0; --paper: #14171b; --card: #1d2228;
  --line: #323a43; --good: #5cc98f; --bad: #ff7488; --front: #17301f; --mark: #5cc98f; } }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 1320px; padding: 1.5rem 1.25rem 4rem;
  color: var(--ink); background: var(--paper); }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .25rem; }
h2 { font-size: 1.2rem; margin: 2.25rem 0 .6rem; padding-bottom: .25rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 0; } p { margin: .4rem 0 .8rem; max-width: 75ch; }
.soft, figcaption, .says { color: var(--soft); } .soft, .says { font-size: .87rem; }
ul { padding-left: 1.2rem; margin: .4rem 0; } li { margin: .2rem 0; max-width: 100ch; overflow-wrap: anywhere; }
ul.checks { list-style: none; padding: 0; } .holds { color: var(--good); }
.failed { color: var(--bad); font-weight: 600; }
.scroll { overflow-x: auto; border: 1px solid var(--line); border-radius: 8px; max-height: 75vh; }
table { border-collapse: collapse; font-size: .82rem; width: 100%; font-variant-numeric: tabular-nums; }
td, th { padding: .3rem .6rem; text-align: right; white-space: nowrap; }
th { position: sticky; top: 0; background: var(--card); border-bottom: 1px solid var(--line); z-index: 1; }
table.sortable th { cursor: pointer; user-select: none; }
th[aria-sort=ascending]::after { content: " \\25b4"; } th[aria-sort=descending]::after { content: " \\25be"; }
td:first-child, th:first-child { text-align: center; color: var(--mark); }
td:nth-child(2), th:nth-child(2), table.plain td { text-align: left; white-space: normal; min-width: 9rem; }
tbody tr + tr td { border-top: 1px solid var(--line); } tbody tr:hover { background: var(--card); }
tr.front { background: var(--front); font-weight: 600; } tr.unsound { color: var(--soft); }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 380px), 1fr)); gap: 1rem; }
.figures img { background: #fff; border-radius: 8px; border: 1px solid var(--line); }
figure { margin: 0; min-width: 0; } figcaption { font-size: .8rem; padding-top: .25rem; }
img { display: block; width: 100%; height: auto; }
.point { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: .8rem; margin: 0 0 1rem; }
.point .says { margin: .1rem 0 .6rem; max-width: none; }
.maps { display: grid; grid-template-columns: repeat(3, 1fr); gap: .7rem; } .maps img { image-rendering: pixelated; }
.truth { max-width: 34rem; } .truth img { image-rendering: pixelated; }
.scales { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 300px), 1fr)); gap: 1rem;
  margin: 0 0 1rem; }
.bar { height: .8rem; border-radius: 3px; } .ticks { display: flex; justify-content: space-between; font-size: .75rem; }
.badge { display: inline-block; font-size: .72rem; font-weight: 600; border: 1px solid var(--mark); color: var(--mark);
  border-radius: 99px; padding: 0 .5rem; margin-left: .4rem; vertical-align: middle; }
@media (max-width: 640px) { body { padding: 1rem .8rem 3rem; } .maps { grid-template-columns: 1fr; } }
"""

SCRIPT = """
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const value = (row, k) => {
    const text = row.cells[k].textContent.trim(), number = parseFloat(text);
    return Number.isNaN(number) ? text : number;
  };
  table.tHead.addEventListener("click", (event) => {
    const head = event.target.closest("th");
    if (!head) return;
    const k = head.cellIndex, up = head.getAttribute("aria-sort") !== "ascending";
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const rows = [...body.rows].sort((a, b) => {
      const x = value(a, k), y = value(b, k);
      if (typeof x !== typeof y) return typeof x === "number" ? -1 : 1;  // text sorts last
      return (x < y ? -1 : x > y ? 1 : 0) * (up ? 1 : -1);
    });
    body.append(...rows);
  });
}
"""
