// Plots that zoom: drag along the horizontal axis, or use the wheel; a double click shows all of it again. Plots of one
// group share their horizontal axis. The numbers are in the page, as 32-bit ones; a line has its own x or the group's.
(function () {
  "use strict";
  const plots = JSON.parse(document.getElementById("zoom-data").textContent);
  const LEFT = 68, RIGHT = 10, TOP = 8, BOTTOM = 34, NEAR = 8, groups = {};

  function numbers(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  function ticks(low, high, count, log) {
    if (log && high - low <= 0.7)  // less than a factor of five: even steps of the values themselves
      return ticks(10 ** low, 10 ** high, count, false).map(([value, text]) => [Math.log10(value), text]);
    if (log) {
      const found = [], factors = high - low > 4 ? [1] : [1, 2, 5];
      for (let k = Math.floor(low); k <= high; k++)
        for (const factor of factors) found.push(k + Math.log10(factor));
      return found.filter((v) => v >= low && v <= high).map((v) => [v, String(Number((10 ** v).toPrecision(3)))]);
    }
    const raw = (high - low) / count, unit = Math.pow(10, Math.floor(Math.log10(raw))), found = [];
    const step = unit * [1, 2, 5, 10].find((factor) => unit * factor >= raw);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let k = Math.ceil(low / step); k * step <= high; k++)
      found.push([k * step, (k * step).toFixed(digits)]);
    return found;
  }

  // Everything is drawn in u and v: the values themselves, or their decimal logarithms.
  function prepare(plot) {
    plot.group = groups[plot.x.group] = groups[plot.x.group] || { plots: [], start: Infinity, end: -Infinity };
    plot.group.plots.push(plot);
    for (const line of plot.lines) {
      line.y = numbers(line.data);
      line.v = plot.log ? line.y.map(Math.log10) : line.y;
      const own = line.x === null ? null : numbers(line.x);
      line.at = own ? (k) => own[k] : (k) => plot.x.start + plot.x.step * k;
      line.u = plot.x.log ? (k) => Math.log10(line.at(k)) : line.at;
      line.span = own
        ? () => [0, own.length - 1]
        : (view) => [
            Math.max(0, Math.floor((view.from - plot.x.start) / plot.x.step)),
            Math.min(line.y.length - 1, Math.ceil((view.until - plot.x.start) / plot.x.step)),
          ];
      const room = own && plot.x.log ? 0.1 : 0;
      for (let k = 0; k < line.y.length; k += own ? 1 : Math.max(1, line.y.length - 1)) {
        plot.group.start = Math.min(plot.group.start, line.u(k) - room);
        plot.group.end = Math.max(plot.group.end, line.u(k) + room);
      }
    }
    plot.group.from = plot.group.start;
    plot.group.until = plot.group.end;
  }

  function seen(plot, visit) {
    for (const line of plot.lines) {
      const [first, last] = line.span(plot.group);
      for (let k = first; k <= last; k++)
        if (line.x === null || (line.u(k) >= plot.group.from && line.u(k) <= plot.group.until)) visit(line, k);
    }
  }

  function draw(plot) {
    const box = plot.canvas, ratio = window.devicePixelRatio || 1, width = box.clientWidth, height = box.clientHeight;
    const { from, until } = plot.group, pen = box.getContext("2d");
    box.width = width * ratio;
    box.height = height * ratio;
    pen.scale(ratio, ratio);
    let low = Infinity, high = -Infinity;
    seen(plot, (line, k) => {
      low = Math.min(low, line.v[k]);
      high = Math.max(high, line.v[k]);
    });
    const room = 0.06 * (high - low) || 1;
    low -= room;
    high += room;
    const x = (u) => LEFT + ((u - from) / (until - from)) * (width - LEFT - RIGHT);
    const y = (v) => height - BOTTOM - ((v - low) / (high - low)) * (height - TOP - BOTTOM);
    plot.place = (line, k) => [x(line.u(k)), y(line.v[k])];
    pen.font = "12px system-ui, sans-serif";
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.clip();
    pen.fillStyle = "#e3e3e3";
    for (const [a, b] of plot.shade) pen.fillRect(x(a), TOP, Math.max(0.5, x(b) - x(a)), height);
    if (plot.below) pen.fillRect(LEFT, y(plot.log ? Math.log10(plot.below) : plot.below), width, height);
    for (const line of plot.lines) {
      const [first, last] = line.span(plot.group);
      pen.strokeStyle = pen.fillStyle = line.colour;
      pen.globalAlpha = line.faint ? 0.35 : 1;
      pen.lineWidth = line.width;
      pen.setLineDash(line.dash);
      pen.beginPath();
      for (let k = first; k <= last; k++) {
        if (line.width) pen.lineTo(x(line.u(k)), y(line.v[k]));
        if (line.mark) pen.fillRect(x(line.u(k)) - line.mark / 2, y(line.v[k]) - line.mark / 2, line.mark, line.mark);
      }
      if (line.width) pen.stroke();
      pen.globalAlpha = 1;
    }
    pen.restore();
    pen.strokeStyle = "#888";
    pen.strokeRect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    pen.fillStyle = "#333";
    pen.textAlign = "center";
    for (const [u, text] of ticks(from, until, 8, plot.x.log)) pen.fillText(text, x(u), height - BOTTOM + 15);
    pen.fillText(plot.x.label, (LEFT + width) / 2, height - 4);
    pen.textAlign = "right";
    for (const [v, text] of ticks(low, high, 5, plot.log)) pen.fillText(text, LEFT - 6, y(v) + 4);
    if (plot.drag) {
      pen.fillStyle = "rgba(0, 114, 178, 0.2)";
      pen.fillRect(plot.drag[0], TOP, plot.drag[1] - plot.drag[0], height - TOP - BOTTOM);
    }
  }

  function show(group, a, b) {
    group.from = Math.max(group.start, a);
    group.until = Math.min(group.end, Math.max(b, group.from + 1e-5 * (group.end - group.start)));
    group.plots.forEach(draw);
  }

  function told(plot, left, top, u) {
    let best = NEAR, text = plot.x.log ? "" : u.toPrecision(6) + " s";
    for (const line of plot.lines.filter((each) => each.notes))
      for (let k = 0; k < line.y.length; k++) {
        const [a, b] = plot.place(line, k), away = Math.hypot(a - left, b - top);
        if (away < best) [best, text] = [away, line.name + ": " + line.notes[k]];
      }
    return text;
  }

  function listen(plot) {
    const box = plot.canvas, group = plot.group;
    const at = (x) => group.from + ((x - LEFT) / (box.clientWidth - LEFT - RIGHT)) * (group.until - group.from);
    box.addEventListener("mousedown", (event) => (plot.drag = [event.offsetX, event.offsetX]));
    box.addEventListener("mousemove", (event) => {
      box.title = told(plot, event.offsetX, event.offsetY, at(event.offsetX));
      if (plot.drag) {
        plot.drag[1] = event.offsetX;
        draw(plot);
      }
    });
    window.addEventListener("mouseup", () => {
      if (!plot.drag) return;
      const [a, b] = plot.drag.map(at).sort((one, two) => one - two), wide = Math.abs(plot.drag[1] - plot.drag[0]) > 4;
      plot.drag = null;
      show(group, wide ? a : group.from, wide ? b : group.until);
    });
    box.addEventListener("dblclick", () => show(group, group.start, group.end));
    box.addEventListener("wheel", (event) => {
      const centre = at(event.offsetX), factor = event.deltaY > 0 ? 1.25 : 0.8;
      show(group, centre + (group.from - centre) * factor, centre + (group.until - centre) * factor);
      event.preventDefault();
    });
  }

  // Lines on one grid side by side; points with an x of their own below each other, with what they stand for.
  function csv(plot) {
    const rows = [], cell = (text) => '"' + text.replace(/"/g, '""') + '"';
    if (plot.lines[0].x === null) {
      const [first, last] = plot.lines[0].span(plot.group);
      rows.push([plot.x.label, ...plot.lines.map((line) => line.name)].map(cell));
      for (let k = first; k <= last; k++) rows.push([plot.lines[0].at(k), ...plot.lines.map((line) => line.y[k])]);
    } else {
      rows.push(["series", "what", plot.x.label, plot.label].map(cell));
      seen(plot, (line, k) => line.notes && rows.push([cell(line.name), cell(line.notes[k]), line.at(k), line.y[k]]));
    }
    return URL.createObjectURL(new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
  }

  plots.forEach(prepare);
  document.querySelectorAll("[data-zoom]").forEach((place) => {
    const plot = plots[Number(place.dataset.zoom)], detail = place.querySelector(".first-contact");
    plot.canvas = place.querySelector("canvas");
    place.querySelector(".whole").onclick = () => show(plot.group, plot.group.start, plot.group.end);
    if (detail) detail.onclick = () => show(plot.group, plot.detail[0], plot.detail[1]);
    place.querySelector(".data").onclick = (event) => (event.currentTarget.href = csv(plot));
    listen(plot);
  });
  const all = () => Object.values(groups).forEach((group) => show(group, group.from, group.until));
  window.zoomPlots = { groups, show };
  window.addEventListener("resize", all);
  all();
})();
