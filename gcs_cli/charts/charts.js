// Draws the charts of a page with plotly.js: colours of the scheme, linked time axes, export, time slider.
(() => {
  "use strict";
  const config = {displaylogo: false, responsive: true};
  const flat = {...config, modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]]};
  const space = {...config, modeBarButtons: [["tableRotation", "orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"]]};
  const charts = [];

  function painted(value) {
    if (typeof value === "string") {
      const name = /^var\((--[\w-]+)\)$/.exec(value);
      return name ? getComputedStyle(document.documentElement).getPropertyValue(name[1]).trim() : value;
    }
    if (Array.isArray(value)) return typeof value[0] === "number" || value[0] === null ? value : value.map(painted);
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, painted(part)]));
  }

  const NARROW_PX = 560, TOOLBAR_PX = 28, LABEL_PX = 18; // below this width the legend stands under the toolbar

  // Draw a chart with as much room above it as toolbar and legend need.
  async function draw(chart) {
    const layout = painted(chart.layout), bar = chart.plot.clientWidth < NARROW_PX ? TOOLBAR_PX : 0;
    if (bar && layout.scene) { // a narrow scene shows less to both sides
      for (const axis of ["x", "y", "z"]) layout.scene.camera.eye[axis] *= 2.1;
    }
    const show = above => {
      const height = chart.layout.height + above, margin = {...layout.margin, t: layout.margin.t + above};
      chart.plot.style.height = `${height}px`;
      const fitted = {...layout, height, margin, legend: {...layout.legend, y: 1 - bar / height}};
      return Plotly.react(chart.plot, painted(chart.data), fitted, chart.layout.scene ? space : flat);
    };
    await show(bar);
    const legend = chart.plot.querySelector(".legend");
    const needed = bar + (legend ? legend.getBBox().height : 0) - layout.margin.t + LABEL_PX;
    if (needed > bar) await show(Math.ceil(needed));
  }

  // A chart whose time axis is zoomed or reset takes the others along.
  function link(chart) {
    chart.plot.on("plotly_relayout", event => {
      const range = event["xaxis.range"] || ("xaxis.range[0]" in event && [event["xaxis.range[0]"], event["xaxis.range[1]"]]);
      if (!range && !event["xaxis.autorange"]) return;
      for (const other of charts) {
        if (other === chart || !other.linked || !other.plot.layout) continue;
        const now = other.plot.layout.xaxis;
        if (range ? now.range[0] !== range[0] || now.range[1] !== range[1] : !now.autorange) {
          Plotly.relayout(other.plot, range ? {"xaxis.range": [...range]} : {"xaxis.autorange": true});
        }
      }
    });
  }

  function save(name, text) {
    const anchor = document.createElement("a");
    anchor.href = URL.createObjectURL(new Blob([text], {type: "text/csv"}));
    anchor.download = name;
    anchor.click();
    URL.revokeObjectURL(anchor.href);
  }

  // names are escaped for plotly's pseudo-HTML
  const text = name => String(name).replaceAll("&lt;", "<").replaceAll("&gt;", ">").replaceAll("&amp;", "&");
  const cell = value => /[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : value ?? "";

  function csv(chart) {
    const axis = (kind, name) => (chart.layout[`${kind}axis${name.slice(1)}`] || {title: {text: kind}}).title.text;
    const rows = [["series", "x", "y", "z", "x axis", "y axis"]];
    for (const trace of chart.data) {
      const titles = trace.type === "scatter3d" ? ["east [m]", "north [m]"] : [axis("x", trace.xaxis), axis("y", trace.yaxis)];
      trace.x.forEach((x, i) => x !== null && rows.push([text(trace.name), x, trace.y[i], trace.z ? trace.z[i] : "", ...titles]));
    }
    return rows.map(row => row.map(cell).join(",")).join("\n") + "\n";
  }

  function exports(chart) {
    for (const button of chart.card.querySelectorAll("button[data-format]")) {
      button.addEventListener("click", () => {
        const format = button.dataset.format;
        if (format === "csv") return save(`${chart.file}.csv`, csv(chart));
        return Plotly.downloadImage(chart.plot, {
          format, filename: chart.file, width: chart.plot.clientWidth, height: chart.plot.clientHeight, scale: format === "png" ? 2 : 1,
        });
      });
    }
  }

  // The vehicle at pose i: arms and nose in the body frame, turned by roll, pitch and yaw, in metres east, north, up.
  function vehicle(poses, i) {
    const s = poses.size, body = [[s, 0, 0], [-s, 0, 0], null, [0, s, 0], [0, -s, 0], null, [0, 0, 0], [2 * s, 0, 0]];
    const [cr, cp, cy] = [poses.roll, poses.pitch, poses.yaw].map(angle => Math.cos(angle[i]));
    const [sr, sp, sy] = [poses.roll, poses.pitch, poses.yaw].map(angle => Math.sin(angle[i]));
    const world = body.map(point => point && [
      poses.east[i] + sy * cp * point[0] + (sy * sp * sr + cy * cr) * point[1],
      poses.north[i] + cy * cp * point[0] + (cy * sp * sr - sy * cr) * point[1],
      poses.up[i] + sp * point[0] - cp * sr * point[1],
    ]);
    return [0, 1, 2].map(axis => world.map(point => point && point[axis]));
  }

  function playback(chart) {
    const poses = chart.playback, last = chart.data.length - 1;
    const slider = chart.card.querySelector("input"), shown = chart.card.querySelector("output"), button = chart.card.querySelector(".play");
    const show = i => {
      const [x, y, z] = vehicle(poses, i);
      Object.assign(chart.data[last], {x, y, z});
      slider.value = i;
      shown.value = `${poses.time[i].toFixed(1)} s`;
      if (chart.plot.data) Plotly.restyle(chart.plot, {x: [x], y: [y], z: [z]}, [last]);
    };
    let timer = 0;
    const stop = () => { clearInterval(timer); timer = 0; button.textContent = "Play"; };
    slider.max = poses.time.length - 1;
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    button.addEventListener("click", () => {
      if (timer) return stop();
      if (slider.value === slider.max) show(0);
      button.textContent = "Pause";
      const from = performance.now() / 1000 - poses.time[slider.value];
      timer = setInterval(() => {
        let i = Number(slider.value);
        while (i < slider.max && poses.time[i] + from < performance.now() / 1000) i++;
        show(i);
        if (i >= slider.max) stop();
      }, 50);
    });
    show(0);
  }

  async function show(chart) {
    if (chart.playback) playback(chart);
    await draw(chart);
    exports(chart);
    if (chart.linked) link(chart);
  }

  async function start() {
    for (const card of document.querySelectorAll("[data-chart]")) {
      const chart = {...JSON.parse(card.querySelector("script").textContent), card, plot: card.querySelector(".plot")};
      charts.push(chart);
    }
    charts.sort((a, b) => Boolean(a.layout.scene) - Boolean(b.layout.scene)); // without a graphics card these take seconds
    for (const chart of charts) {
      const fold = chart.card.closest("details:not([open])"); // has no width yet
      if (fold) fold.addEventListener("toggle", () => show(chart), {once: true});
      else await show(chart);
      await new Promise(resolve => setTimeout(resolve));
    }
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.filter(chart => chart.plot.data).forEach(draw));
    document.documentElement.dataset.charts = "drawn";
  }
  start();
})();
