/* Measured and modelled signals over time: one plot of values above one of errors, per section that has data.
   The measured line is thin and drawn last, above those of the models. */
(function () {
  "use strict";
  const LEVELS = 65534, BREAK = -32768, HEIGHTS = [260, 170], STEP = 0.2;
  const COLOURS = { measured: "--ink", before: "--before", after: "--after", refined: "--refined" };
  const DASHES = { before: [6, 4], refined: [2, 2] };
  const store = document.getElementById("trace-data");
  if (!store || typeof uPlot === "undefined") return;
  const plots = JSON.parse(store.textContent);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function bytes(text) {
    return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  }
  function line([low, high, text]) {
    const steps = new Int16Array(bytes(text));
    return Array.from(steps, (s) => (s === BREAK ? null : low + ((s + LEVELS / 2) * (high - low)) / LEVELS));
  }
  function decoded(plot, run) {
    if (!run.lines) {
      const time = Array.from(new Float32Array(bytes(run.time)));
      const measured = line(run.measured);
      const errors = ["before", "after", "refined"].filter((name) => name in run).map((name) => ({ name, values: line(run[name]) }));
      const modelled = errors.map((e) => e.values.map((v, i) =>
        v === null || measured[i] === null ? null : measured[i] + v * plot.valuePerError));
      run.lines = { errors, values: [time, ...modelled, measured], misses: [time, ...errors.map((e) => e.values)] };
    }
    return run.lines;
  }
  const tidy = (v) => v.toString().replace("-", "−");
  function shown(unit) {
    return (u, v) => (v === null || v === undefined ? "–" : tidy(Number(v.toPrecision(4))) + " " + unit);
  }

  function options(names, label, unit, width, height, key, last, follow) {
    const axis = {
      stroke: () => colour("--muted"), font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif",
      grid: { stroke: () => colour("--grid"), width: 1 }, ticks: { stroke: () => colour("--grid"), width: 1 },
    };
    return {
      width, height, scales: { x: { time: false } },
      cursor: { sync: { key, scales: ["x", null] }, drag: { x: true, y: false }, points: { size: 6 } },
      legend: { live: true },
      axes: [
        Object.assign({}, axis, last ? { label: "time [s]", labelSize: 18, size: 30 } : { size: 30 }),
        Object.assign({}, axis, { label: label + " [" + unit + "]", labelSize: 20, size: 58, space: 26,
          values: (u, splits) => splits.map((v) => tidy(Number(v.toPrecision(8)))) }),
      ],
      series: [
        { label: "time", value: shown("s") },
        ...names.map((name) => ({
          label: name === "measured" ? "measured" : "model " + name,
          stroke: () => colour(COLOURS[name]), width: name === "measured" || last ? 1.1 : 2.2,
          dash: DASHES[name], value: shown(unit), points: { show: false },
        })),
      ],
      hooks: { setScale: [follow], ready: [reachable] },
    };
  }

  /* The legend switches a line with the mouse; let the keyboard do it too. */
  function reachable(u) {
    u.root.querySelectorAll(".u-legend .u-series").forEach((row, i) => {
      if (i === 0) return;
      const head = row.querySelector("th");
      head.tabIndex = 0;
      head.setAttribute("role", "button");
      head.addEventListener("keydown", (e) => {
        if (e.key !== "Enter" && e.key !== " ") return;
        e.preventDefault();
        u.setSeries(i, { show: !u.series[i].show });
      });
    });
  }

  function view(section) {
    const plot = plots[section.dataset.plot];
    const host = section.querySelector(".chart"), choice = section.querySelector("select");
    let charts = [], busy = false, range = [0, 1], whole = [0, 1];

    function zoom(low, high) {
      const span = Math.min(high - low, whole[1] - whole[0]);
      if (!(span > 0)) return;
      const start = Math.max(whole[0], Math.min(low, whole[1] - span));
      range = [start, start + span];
      busy = true;
      charts.forEach((u) => u.setScale("x", { min: range[0], max: range[1] }));
      busy = false;
    }
    function about(factor, centre) {
      const c = centre === undefined ? (range[0] + range[1]) / 2 : centre;
      zoom(c - (c - range[0]) * factor, c + (range[1] - c) * factor);
    }
    function move(share) {
      const d = share * (range[1] - range[0]);
      zoom(range[0] + d, range[1] + d);
    }
    function follow(u, scale) {
      if (busy || scale !== "x" || charts.length < 2) return;
      zoom(u.scales.x.min, u.scales.x.max);
    }
    function build() {
      const lines = decoded(plot, plot.runs[choice.selectedIndex]);
      const names = lines.errors.map((e) => e.name), width = host.clientWidth, key = section.dataset.plot;
      charts.forEach((u) => u.destroy());
      charts = [];
      busy = true;
      const made = [
        new uPlot(options([...names, "measured"], plot.quantity, plot.unit, width, HEIGHTS[0], key, false, follow),
          lines.values, host),
        new uPlot(options(names, "error", plot.errorUnit, width, HEIGHTS[1], key, true, follow), lines.misses, host),
      ];
      charts = made;
      busy = false;
      whole = [lines.values[0][0], lines.values[0][lines.values[0].length - 1]];
      range = whole.slice();
      charts.forEach(gestures);
    }
    /* Drag selects; with Shift it moves. The wheel zooms with Ctrl only, so that it still scrolls the page. */
    function gestures(u) {
      const over = u.root.querySelector(".u-over");
      over.addEventListener("wheel", (e) => {
        if (!e.ctrlKey) return;
        e.preventDefault();
        about(e.deltaY > 0 ? 1.25 : 0.8, u.posToVal(e.clientX - over.getBoundingClientRect().left, "x"));
      }, { passive: false });
      over.addEventListener("mousedown", (e) => {
        if (!e.shiftKey || e.button !== 0) return;
        e.preventDefault();
        e.stopImmediatePropagation();
        const from = e.clientX, start = range.slice(), per = (range[1] - range[0]) / over.clientWidth;
        const drag = (m) => zoom(start[0] - (m.clientX - from) * per, start[1] - (m.clientX - from) * per);
        const end = () => { removeEventListener("mousemove", drag); removeEventListener("mouseup", end); };
        addEventListener("mousemove", drag);
        addEventListener("mouseup", end);
      }, true);
      over.addEventListener("dblclick", () => zoom(...whole));
    }
    const act = {
      in: () => about(0.5), out: () => about(2), left: () => move(-STEP), right: () => move(STEP),
      whole: () => zoom(...whole), worst: () => zoom(...plot.runs[choice.selectedIndex].worst),
    };
    const keys = { "+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", 0: "whole", Home: "whole" };
    section.querySelectorAll("[data-act]").forEach((b) => b.addEventListener("click", () => act[b.dataset.act]()));
    host.addEventListener("keydown", (e) => {
      if (e.target !== host || !(e.key in keys) || e.ctrlKey || e.metaKey) return;
      e.preventDefault();
      act[keys[e.key]]();
    });
    choice.addEventListener("change", build);
    section.classList.add("live");
    build();
    return {
      resize: () => charts.forEach((u, i) => u.setSize({ width: host.clientWidth, height: HEIGHTS[i] })),
      recolour: () => {
        const kept = range;
        build();
        zoom(...kept);
      },
    };
  }

  const views = [];
  const seen = new IntersectionObserver((entries) => {
    entries.filter((e) => e.isIntersecting).forEach((e) => {
      seen.unobserve(e.target);
      views.push(view(e.target));
    });
  }, { rootMargin: "600px" });
  document.querySelectorAll("[data-plot]").forEach((section) => seen.observe(section));
  addEventListener("resize", () => views.forEach((v) => v.resize()));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => views.forEach((v) => v.recolour()));
})();
