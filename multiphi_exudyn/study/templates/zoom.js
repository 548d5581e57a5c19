// Histories that zoom together: drag along the time axis, or use the wheel; a double click shows all of it again.
// The numbers are in the page, as 32-bit ones on an even grid of times.
(function () {
  "use strict";
  const plots = JSON.parse(document.getElementById("zoom-data").textContent);
  const LEFT = 68, RIGHT = 10, TOP = 8, BOTTOM = 34, view = { start: Infinity, end: -Infinity };

  function ticks(low, high, count) {
    const raw = (high - low) / count, unit = Math.pow(10, Math.floor(Math.log10(raw))), found = [];
    const step = unit * [1, 2, 5, 10].find((factor) => unit * factor >= raw);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push([k * step, (k * step).toFixed(digits)]);
    return found;
  }

  function prepare(plot) {
    for (const line of plot.lines) {
      const bytes = Uint8Array.from(atob(line.data), (c) => c.charCodeAt(0));
      line.y = new Float32Array(bytes.buffer);
    }
    plot.at = (k) => plot.x.start + plot.x.step * k;
    plot.span = () => [
      Math.max(0, Math.floor((view.from - plot.x.start) / plot.x.step)),
      Math.min(plot.lines[0].y.length - 1, Math.ceil((view.until - plot.x.start) / plot.x.step)),
    ];
    view.start = Math.min(view.start, plot.x.start);
    view.end = Math.max(view.end, plot.at(plot.lines[0].y.length - 1));
  }

  function draw(plot) {
    const box = plot.canvas, ratio = window.devicePixelRatio || 1, width = box.clientWidth, height = box.clientHeight;
    const pen = box.getContext("2d"), [first, last] = plot.span();
    box.width = width * ratio;
    box.height = height * ratio;
    pen.scale(ratio, ratio);
    let low = Infinity, high = -Infinity;
    for (const line of plot.lines)
      for (let k = first; k <= last; k++) {
        low = Math.min(low, line.y[k]);
        high = Math.max(high, line.y[k]);
      }
    const room = 0.06 * (high - low) || 1;
    low -= room;
    high += room;
    const x = (t) => LEFT + ((t - view.from) / (view.until - view.from)) * (width - LEFT - RIGHT);
    const y = (v) => height - BOTTOM - ((v - low) / (high - low)) * (height - TOP - BOTTOM);
    pen.font = "12px system-ui, sans-serif";
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.clip();
    pen.fillStyle = "#e3e3e3";
    for (const [a, b] of plot.shade) pen.fillRect(x(a), TOP, Math.max(0.5, x(b) - x(a)), height);
    for (const line of plot.lines) {
      pen.strokeStyle = line.colour;
      pen.lineWidth = line.width;
      pen.setLineDash(line.dash);
      pen.beginPath();
      for (let k = first; k <= last; k++) pen.lineTo(x(plot.at(k)), y(line.y[k]));
      pen.stroke();
    }
    pen.restore();
    pen.strokeStyle = "#888";
    pen.strokeRect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.fillStyle = "#333";
    pen.textAlign = "center";
    for (const [t, text] of ticks(view.from, view.until, 8)) pen.fillText(text, x(t), height - BOTTOM + 15);
    pen.fillText("time [s]", (LEFT + width) / 2, height - 4);
    pen.textAlign = "right";
    for (const [v, text] of ticks(low, high, 5)) pen.fillText(text, LEFT - 6, y(v) + 4);
    if (plot.drag) {
      pen.fillStyle = "rgba(0, 114, 178, 0.2)";
      pen.fillRect(plot.drag[0], TOP, plot.drag[1] - plot.drag[0], height - TOP - BOTTOM);
    }
  }

  function show(a, b) {
    view.from = Math.max(view.start, a);
    view.until = Math.min(view.end, Math.max(b, view.from + 1e-5 * (view.end - view.start)));
    plots.forEach(draw);
  }

  function listen(plot) {
    const box = plot.canvas;
    const at = (x) => view.from + ((x - LEFT) / (box.clientWidth - LEFT - RIGHT)) * (view.until - view.from);
    box.addEventListener("mousedown", (event) => (plot.drag = [event.offsetX, event.offsetX]));
    box.addEventListener("mousemove", (event) => {
      box.title = at(event.offsetX).toPrecision(6) + " s";
      if (plot.drag) {
        plot.drag[1] = event.offsetX;
        draw(plot);
      }
    });
    window.addEventListener("mouseup", () => {
      if (!plot.drag) return;
      const [a, b] = plot.drag.map(at).sort((one, two) => one - two), wide = Math.abs(plot.drag[1] - plot.drag[0]) > 4;
      plot.drag = null;
      show(wide ? a : view.from, wide ? b : view.until);
    });
    box.addEventListener("dblclick", () => show(view.start, view.end));
    box.addEventListener("wheel", (event) => {
      const centre = at(event.offsetX), factor = event.deltaY > 0 ? 1.25 : 0.8;
      show(centre + (view.from - centre) * factor, centre + (view.until - centre) * factor);
      event.preventDefault();
    });
  }

  function csv(plot) {
    const [first, last] = plot.span(), cell = (text) => '"' + text.replace(/"/g, '""') + '"';
    const rows = [["time [s]", ...plot.lines.map((line) => line.name)].map(cell)];
    for (let k = first; k <= last; k++) rows.push([plot.at(k), ...plot.lines.map((line) => line.y[k])]);
    return URL.createObjectURL(new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
  }

  plots.forEach(prepare);
  document.querySelectorAll("[data-zoom]").forEach((place) => {
    const plot = plots[Number(place.dataset.zoom)], detail = place.querySelector(".first-contact");
    plot.canvas = place.querySelector("canvas");
    place.querySelector(".whole").onclick = () => show(view.start, view.end);
    if (detail) detail.onclick = () => show(plot.detail[0], plot.detail[1]);
    place.querySelector(".data").onclick = (event) => (event.currentTarget.href = csv(plot));
    listen(plot);
  });
  window.addEventListener("resize", () => show(view.from, view.until));
  show(view.start, view.end);
})();
