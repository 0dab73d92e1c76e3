// The motion at the point: four plots, the animated mass, and the diagram below the plane.
window.Motion = (() => {
  "use strict";
  const byId = (id) => document.getElementById(id);
  const { Plot, LOOK, MARGINS, draws, quantity, power_of } = window.Plots;
  const motions = [], order = [1, 2, 0];  // the present motion lies on top
  let facts = { period: 1, single: true, force: 0, label: "displacement y", low: -1, high: 0, colors: [] };
  let line = { x: [], y: [], here: 0 };
  let playing = false, clock = 0, before = 0;
  const each = (draw) => { for (const slot of order) if (motions[slot]) draw(motions[slot], [LOOK.blue, LOOK.red, LOOK.green][slot], slot === 0); };
  const empty = () => !motions[0] || !motions[0].time.length;
  // Number of ascending values below a bound.
  const place = (values, bound) => {
    let low = 0, high = values.length;
    while (low < high) { const mid = (low + high) >> 1; if (values[mid] < bound) low = mid + 1; else high = mid; }
    return low;
  };
  const seen = (time, [low, high]) => [Math.max(place(time, low) - 1, 0), Math.min(place(time, high) + 1, time.length)];

  // ---- the plots
  // A pinned motion with another gap has its own wall.
  const draw_faces = (plot, across) => each((motion, color, first) => {
    const known = motions[0] ? motions[0].walls.map(({ place }) => place[0]) : [];
    if (first) return;
    for (const { side, place } of motion.walls) if (place.length === 1 && !known.includes(place[0])) plot.face(place[0], across, color, side);
  });
  const phase = (name, title, draw) => new Plot(name, {
    title, x: "displacement y [m]", y: "velocity [m/s]",
    paint: (plot) => { draw_walls(plot, false); draw_faces(plot, false); each((motion, color, first) => draw(plot, motion, color, first)); },
  });
  // Regions behind fixed stops, and positions of moving stops over time.
  const draw_walls = (plot, across) => {
    if (!motions[0]) return;
    for (const { side, place } of motions[0].walls) {
      if (place.length === 1) plot.stop(place[0], across, side);
      else if (across) plot.line(motions[0].time, place, LOOK.soft, 1.4, ...seen(motions[0].time, plot.range.x));
    }
  };
  const plots = {
    history: new Plot("history", {
      title: "Time history", x: "time [s]", y: "displacement y [m]",
      paint: (plot) => {
        draw_walls(plot, true);
        draw_faces(plot, true);
        each((motion, color, first) => {
          plot.line(motion.time, motion.displacement, color, first ? 1.4 : 1.2, ...seen(motion.time, plot.range.x));
          plot.marks(motion.hits, motion.hit_places, color);
        });
        if (motions[0]) plot.bars(motions[0].rest_begin, motions[0].rest_end, motions[0].rest_places, "#e0c800");
        if (playing && !empty()) plot.rule("x", now(), LOOK.ink, [2, 3]);  // not the colour of a pin
      },
    }),
    portrait: phase("portrait", "Phase portrait", (plot, motion, color, first) => {
      plot.line(motion.displacement, motion.velocity, color, first ? 1.4 : 1.2, 0, motion.turn);
    }),
    poincare: phase("poincare", "Poincaré map: once per driving period", (plot, motion, color) => plot.dots(motion.looks_y, motion.looks_v, color)),
    impact_map: new Plot("impact_map", {
      title: "Impact map: phase and velocity", x: "phase of the driving period", y: "impact velocity [m/s]",
      paint: (plot) => each((motion, color) => plot.dots(motion.phases, motion.speeds, color)),
    }),
  };
  const below = new Plot("line", {
    x: "", y: "impact velocity [m/s]", title: "Impacts of the motion from rest", fixed: MARGINS, still: true,
    paint: (plot) => { plot.dots(line.x, line.y, LOOK.ink, 1.6); plot.rule("x", line.here, LOOK.blue, [6, 4]); },
  });

  // ---- the mass between its stops
  const canvas = byId("play-canvas"), pen = canvas.getContext("2d");
  const now = () => {
    const { time } = motions[0], first = time[0], last = time[time.length - 1];
    return last > first ? first + (clock * facts.period) % (last - first) : first;
  };
  const position = (time, y, t) => {
    const high = Math.min(Math.max(place(time, t), 1), time.length - 1), low = Math.max(high - 1, 0);
    const span = time[high] - time[low];
    return span > 0 ? y[low] + (y[high] - y[low]) * (t - time[low]) / span : y[low];
  };
  const draw_mass = () => {
    if (empty()) return;
    const ratio = LOOK.ratio || window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const time = now(), at = position(motions[0].time, motions[0].displacement, time);
    const side = 13, left = 96, right = width - 130, middle = height / 2;
    const across = (y) => left + (y - facts.low) * (right - left) / Math.max(facts.high - facts.low, 1e-300), x = across(at);
    const trace = (color, wide, path) => { pen.strokeStyle = pen.fillStyle = color; pen.lineWidth = wide; pen.beginPath(); path(); pen.stroke(); };
    if (facts.single) trace(LOOK.soft, 1.3, () => {
      pen.moveTo(12, 6); pen.lineTo(12, height - 6);
      pen.moveTo(12, middle);
      const from = 20, to = x - 2 * side;
      for (let i = 0; i <= 16; i++) pen.lineTo(from + (to - from) * i / 16, middle + (i % 2 ? 7 : -7) * (i > 0 && i < 16));
      pen.lineTo(to, middle);
    });
    pen.fillStyle = LOOK.blue; pen.fillRect(x - 2 * side, middle - side, 2 * side, 2 * side);
    for (const { side: where, place } of motions[0].walls) {  // a stop below the mass meets its lower face
      const wall = place.length === 1 ? place[0] : position(motions[0].time, place, time);
      const face = across(wall) - (where > 0 ? 0 : 2 * side), behind = (far) => face + where * far;
      pen.fillStyle = LOOK.frame; pen.fillRect(Math.min(face, behind(3)), 4, 3, height - 8);
      trace(LOOK.soft, 1, () => { for (let i = 4; i < height - 4; i += 6) { pen.moveTo(behind(3), i + 5); pen.lineTo(behind(9), i); } });
    }
    const push = facts.force * Math.sin(2 * Math.PI * time / facts.period) * 26, tip = x - side + push, above = middle - side - 4;
    trace(LOOK.red, 2, () => { pen.moveTo(x - side, above); pen.lineTo(tip, above); });
    if (Math.abs(push) > 3) { pen.beginPath(); pen.moveTo(tip + 4 * Math.sign(push), above); pen.lineTo(tip, above - 4); pen.lineTo(tip, above + 4); pen.fill(); }
    pen.fillStyle = LOOK.ink; pen.font = "12px Arial, sans-serif";
    const { x: [, last], y: [lowest, highest] } = plots.history.home, most = Math.max(Math.abs(lowest), Math.abs(highest));
    pen.fillText(`t = ${quantity(time, "s", 4, power_of(last))}`, right + 18, middle - 3);
    pen.fillText(`y = ${quantity(at, "m", 3, power_of(most))}`, right + 18, middle + 13);
  };
  const tick = (stamp) => {
    if (!playing) return;
    if (stamp - before > 30) {
      clock += Math.min(stamp - before, 200) / 1000 * Number(byId("speed").value);
      before = stamp;
      draw_mass();
      plots.history.draw();
    }
    requestAnimationFrame(tick);
  };
  const play = () => {
    playing = !playing;
    byId("play").textContent = playing ? "❚❚ Pause" : "▶ Play";
    before = performance.now();
    plots.history.draw();
    if (playing) requestAnimationFrame(tick);
  };
  byId("play").addEventListener("click", play);
  window.addEventListener("resize", draw_mass);
  draws.push(draw_mass);

  // ---- data from the server
  const takes = {
    motion: ({ slot, walls, begin, turn, lengths, values }) => {
      const motion = { turn }, later = ["time", "hits", "rest_begin", "rest_end"];
      let at = 0;
      for (const [name, length] of Object.entries(lengths)) {
        const part = values.subarray(at, at + length);
        motion[name] = later.includes(name) ? Float64Array.from(part, (time) => begin + time) : part;
        at += length;
      }
      motion.walls = walls.map(([side, name], number) => ({ side, name, place: motion[`wall_${number}`] }));
      motions[slot] = at > 0 ? motion : null;
    },
    facts: (content) => {
      facts = content;
      for (const [name, axis] of [["history", "y"], ["portrait", "x"], ["poincare", "x"]]) plots[name][axis] = `${facts.label} [m]`;
    },
    home: (content) => {
      for (const [name, [x, y]] of Object.entries(content)) {
        const { home } = plots[name];
        if (`${[home.x, home.y]}` !== `${[x, y]}`) plots[name].fit(x, y);  // unchanged axes keep the user's zoom
      }
    },
    line: ({ low, high, dots, ...content }) => {
      line = { ...line, ...content };
      if (!dots) return;
      const half = dots.length / 2, part = (from) => dots.subarray(from, from + half);
      Object.assign(line, { x: Float64Array.from(part(0), (share) => low + share * (high - low)), y: part(half) });
    },
    line_home: ({ x, y, label }) => { if (label) below.x = label; below.fit(x || below.home.x, y || below.home.y); },
  };
  // Update parts by name; redraw each changed plot once.
  const take = (parts) => {
    const names = parts.map(([name]) => name).filter((name) => name.replace(/_\d$/, "") in takes);
    for (const [name, content] of parts) if (names.includes(name)) takes[name.replace(/_\d$/, "")](content);
    if (names.some((name) => name.startsWith("line"))) below.draw();
    if (names.some((name) => !name.startsWith("line"))) { for (const plot of Object.values(plots)) plot.draw(); if (!playing) draw_mass(); }
  };
  return { take, play, below, motions, plots };
})();
