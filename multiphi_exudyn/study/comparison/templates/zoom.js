// Histories that zoom: drag along the time axis, or use the wheel; a double click shows the whole run again. All
// plots share one time axis. The samples are in the page, as 32-bit numbers.
(function () {
  "use strict";
  const given = JSON.parse(document.getElementById("zoom-data").textContent);
  const end = given.start + given.step * (given.count - 1), LEFT = 68, RIGHT = 10, TOP = 8, BOTTOM = 34;
  let from = given.start, until = end;

  function numbers(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  function ticks(low, high, count) {
    const raw = (high - low) / count, unit = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = unit * [1, 2, 5, 10].find((factor) => unit * factor >= raw), found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
    return { values: found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }

  function inside() {
    const first = Math.max(0, Math.floor((from - given.start) / given.step));
    return [first, Math.min(given.count - 1, Math.ceil((until - given.start) / given.step))];
  }

  function draw(plot) {
    const box = plot.canvas, ratio = window.devicePixelRatio || 1, width = box.clientWidth, height = box.clientHeight;
    box.width = width * ratio;
    box.height = height * ratio;
    const pen = box.getContext("2d"), [first, last] = inside();
    pen.scale(ratio, ratio);
    let low = Infinity, high = -Infinity;
    for (const line of plot.lines)
      for (let k = first; k <= last; k++) {
        low = Math.min(low, line.values[k]);
        high = Math.max(high, line.values[k]);
      }
    const room = 0.06 * (high - low) || 1;
    low -= room;
    high += room;
    const x = (t) => LEFT + ((t - from) / (until - from)) * (width - LEFT - RIGHT);
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
      for (let k = first; k <= last; k++) pen.lineTo(x(given.start + k * given.step), y(line.values[k]));
      pen.stroke();
    }
    pen.restore();
    pen.strokeStyle = "#888";
    pen.strokeRect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.fillStyle = "#333";
    const across = ticks(from, until, 8), up = ticks(low, high, 5);
    pen.textAlign = "center";
    for (const t of across.values) pen.fillText(t.toFixed(across.digits), x(t), height - BOTTOM + 15);
    pen.fillText("time [s]", (LEFT + width) / 2, height - 4);
    pen.textAlign = "right";
    for (const v of up.values) pen.fillText(v.toFixed(up.digits), LEFT - 6, y(v) + 4);
    if (plot.drag) {
      pen.fillStyle = "rgba(0, 114, 178, 0.2)";
      pen.fillRect(plot.drag[0], TOP, plot.drag[1] - plot.drag[0], height - TOP - BOTTOM);
    }
  }

  function show(a, b) {
    from = Math.max(given.start, a);
    until = Math.min(end, Math.max(b, from + 4 * given.step));
    given.plots.forEach(draw);
  }

  function listen(plot) {
    const box = plot.canvas;
    const at = (x) => from + ((x - LEFT) / (box.clientWidth - LEFT - RIGHT)) * (until - from);
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
      show(wide ? a : from, wide ? b : until);
    });
    box.addEventListener("dblclick", () => show(given.start, end));
    box.addEventListener("wheel", (event) => {
      const centre = at(event.offsetX), factor = event.deltaY > 0 ? 1.25 : 0.8;
      show(centre + (from - centre) * factor, centre + (until - centre) * factor);
      event.preventDefault();
    });
  }

  function csv(plot) {
    const [first, last] = inside(), rows = [["time [s]", ...plot.lines.map((line) => line.name)].join(",")];
    for (let k = first; k <= last; k++)
      rows.push([given.start + k * given.step, ...plot.lines.map((line) => line.values[k])].join(","));
    return URL.createObjectURL(new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
  }

  document.querySelectorAll("[data-zoom]").forEach((place) => {
    const plot = given.plots[Number(place.dataset.zoom)];
    plot.canvas = place.querySelector("canvas");
    for (const line of plot.lines) line.values = numbers(line.data);
    place.querySelector(".whole").onclick = () => show(given.start, end);
    place.querySelector(".first-contact").onclick = () => show(given.detail[0], given.detail[1]);
    place.querySelector(".data").onclick = (event) => (event.currentTarget.href = csv(plot));
    listen(plot);
  });
  window.zoomHistories = show;
  window.addEventListener("resize", () => show(from, until));
  show(given.start, end);
})();
