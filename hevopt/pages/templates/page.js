"use strict";
// What all pages share: unpacking, figures that follow theme and paper, tables that sort, copying, saving.

const Page = (() => {
  const figures = new Map();
  let library = false;
  let onPaper = false;

  const byId = (id) => document.getElementById(id);
  const say = (text) => { byId("said").textContent = text; };

  function bytes(id) {
    const text = atob(byId(id).textContent);
    const found = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) found[i] = text.charCodeAt(i);
    return found;
  }

  async function unpacked(id) {
    const stream = new Blob([bytes(id)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  }

  async function loadLibrary() {
    const script = document.createElement("script");
    script.textContent = await unpacked("packed-library");
    document.head.append(script);
    library = true;
  }

  // Text that the drawing library would otherwise read as markup.
  const plain = (text) =>
    String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

  function theme() {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue(`--${name}`).trim();
    return {
      paper: of("paper"), panel: of("panel"), ink: of("ink"), muted: of("muted"), rule: of("rule"), grid: of("grid"),
      hatch: of("hatch"), colours: Array.from({ length: 10 }, (_, n) => of(`c${n}`)),
    };
  }

  function axis(look, title, more = {}) {
    return {
      title: { text: title, standoff: 6, font: { size: 12 } }, gridcolor: look.grid, linecolor: look.muted, zerolinecolor: look.muted,
      tickfont: { size: 11 }, ticks: "outside", ticklen: 4, tickcolor: look.muted, automargin: true, ...more,
    };
  }

  function layout(look, width, more = {}) {
    return {
      paper_bgcolor: look.paper, plot_bgcolor: look.paper, separators: ". ",
      font: { family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 12, color: look.ink },
      margin: { l: 58, r: 14, t: 12, b: 46 }, hoverlabel: { bgcolor: look.panel, bordercolor: look.muted, font: { color: look.ink, size: 12 } },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12 } }, ...more,
    };
  }

  // build(look, width) -> { data, layout, height?, least?, on?, fresh?, after? }, or null where there is nothing to draw
  // least: width below which the figure scrolls in its box, and on paper is scaled down; on: event of the library ->
  // what to do; fresh: drawn anew each time, for a figure that would glide into place and be printed on its way; after: what to do with the drawn
  function draw(id) {
    const element = byId(id), build = figures.get(id);
    if (!element || !build || !library) return;
    // A4 within its margins, in CSS pixels.
    const inMaps = element.closest(".maps") !== null;
    const room = onPaper ? (inMaps ? 340 : 690) : element.clientWidth;
    const made = build(theme(), room);
    if (!made) return;
    const width = Math.max(room, made.least ?? 0);
    const most = onPaper ? (inMaps ? 310 : 880) : Infinity, height = Math.min(most, made.height || Number(element.dataset.height));
    const config = { displaylogo: false, displayModeBar: "hover", staticPlot: onPaper, showTips: false, showSendToCloud: false, plotlyServerURL: "",
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
    element.closest("figure").classList.toggle("wider", width > room && !onPaper);
    element.style.zoom = onPaper ? room / width : "";
    if (made.fresh) Plotly.purge(element);
    element.querySelector(".missing")?.remove();
    Plotly.react(element, made.data, { ...made.layout, width, height }, config);
    made.after?.(element);
    nameButtons(element);
    // On paper and back the library begins anew, without what listened to it.
    for (const [name, act] of Object.entries(made.on ?? {})) {
      element.removeAllListeners(name);
      element.on(name, act);
    }
  }

  // The library names its buttons alike in every figure.
  function nameButtons(element) {
    const whole = element.getAttribute("aria-label").split(/[.:;]/)[0];
    for (const button of element.querySelectorAll(".modebar-btn")) button.setAttribute("aria-label", `${button.dataset.title}: ${whole}`);
  }

  function figure(id, build) {
    if (!byId(id)) return;
    figures.set(id, build);
  }

  const pause = () => new Promise((done) => setTimeout(done));

  async function drawAll() {
    for (const id of figures.keys()) {
      draw(id);
      await pause();
    }
  }

  function drawNow() {
    for (const id of figures.keys()) draw(id);
  }

  function watch() {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (!onPaper) drawNow(); });
    let last = document.documentElement.clientWidth, timer = 0;
    addEventListener("resize", () => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        if (onPaper || document.documentElement.clientWidth === last) return;
        last = document.documentElement.clientWidth;
        drawNow();
      }, 120);
    });
    const paper = matchMedia("print");
    const turn = (on) => {
      if (on === onPaper) return;
      onPaper = on;
      // Styles of print media are not yet in force when printing is announced.
      document.documentElement.classList.toggle("paper", on);
      drawNow();
    };
    paper.addEventListener("change", (event) => turn(event.matches));
    addEventListener("beforeprint", () => turn(true));
    addEventListener("afterprint", () => turn(false));
  }

  function missing(text) {
    for (const note of document.querySelectorAll(".missing")) note.textContent = text;
  }

  // Tables ------------------------------------------------------------------------------------------------------

  function valueOf(cell) {
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    if (cell.classList.contains("number")) return null;
    return cell.dataset.text ?? cell.textContent.trim();
  }

  function sortBy(table, column) {
    const heads = [...table.tHead.rows[0].cells];
    const down = heads[column].getAttribute("aria-sort") === "ascending";
    const rows = [...table.tBodies[0].rows];
    const keyed = rows.map((row, n) => ({ row, n, value: valueOf(row.cells[column]) }));
    keyed.sort((a, b) => {
      if (a.value === null || b.value === null) return (a.value === null) - (b.value === null) || a.n - b.n;
      const order = typeof a.value === "number" ? a.value - b.value : a.value.localeCompare(b.value, "en", { numeric: true });
      return (down ? -order : order) || a.n - b.n;
    });
    heads.forEach((head) => head.removeAttribute("aria-sort"));
    heads[column].setAttribute("aria-sort", down ? "descending" : "ascending");
    table.tBodies[0].append(...keyed.map((entry) => entry.row));
    const { name } = heads[column].querySelector("button").dataset;
    say(`sorted by ${name}, ${down ? "descending" : "ascending"}`);
  }

  function sortable() {
    for (const table of document.querySelectorAll("table.sortable")) {
      // The caption up to where a sentence or a part of it ends: buttons of several tables are told apart by it.
      const whole = table.caption.textContent.trim().split(/[.:;,]/)[0];
      [...table.tHead.rows[0].cells].forEach((head, column) => {
        const button = head.querySelector("button"), unit = head.querySelector(".unit")?.textContent.trim();
        button.setAttribute("aria-label", `${button.dataset.name}${unit ? ` (${unit})` : ""}: sort ${whole}`);
        button.addEventListener("click", () => sortBy(table, column));
      });
    }
  }

  // Copying and saving ------------------------------------------------------------------------------------------

  function save(contents, type, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([contents], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  async function copy(button) {
    const source = byId(button.dataset.copies);
    try {
      await navigator.clipboard.writeText(source.textContent);
      button.textContent = "Copied";
    } catch {
      // A page from disk may be refused the clipboard; the text is then left selected for the keyboard.
      getSelection().selectAllChildren(source);
      button.textContent = "Selected";
    }
    say(button.textContent);
    setTimeout(() => { button.textContent = "Copy"; }, 2000);
  }

  // What is text shall be seen before anything is unpacked; a hidden page has no frames to wait for.
  const painted = () => new Promise((done) => {
    requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)));
    setTimeout(done, 1000);
  });

  async function start(draws) {
    sortable();
    for (const button of document.querySelectorAll("[data-copies]")) button.addEventListener("click", () => copy(button));
    if (!byId("packed-library").textContent) {
      document.documentElement.dataset.drawn = "yes";
      return;
    }
    await painted();
    try {
      const data = JSON.parse(await unpacked("packed-data"));
      draws(data);
      await loadLibrary();
      watch();
      await drawAll();
      document.documentElement.dataset.drawn = "yes";
    } catch (error) {
      missing("This browser cannot unpack the figure's data; a current one can. Tables and text are complete without it.");
      document.documentElement.dataset.drawn = "no";
      if (typeof DecompressionStream !== "undefined") throw error;
    }
  }

  return { byId, say, bytes, plain, axis, layout, figure, draw, save, start };
})();
