// ---- radius plots: one small panel a branch, all on one scale ----
(function plots() {
  const most = Math.max(...facts.branches.map((b) => b.max_radius_mm), 0);
  const nice = (x) => { const p = 10 ** Math.floor(Math.log10(x)); return [1, 2, 2.5, 5, 10].map((m) => m * p).find((m) => m >= x); };
  const top = most > 0 ? nice(most) : 1;
  const W = 260, H = 118, L = 30, B = 20, T = 8, R = 8;
  const panel = (b) => {
    const face = facts.faces.find((f) => f.name === 'wall_' + b.name);
    const colour = face ? face.colour : '#888';
    const g = svg('svg', {viewBox: `0 0 ${W} ${H}`});
    const x = (s) => L + (W - L - R) * (b.length_mm > 0 ? s / b.length_mm : 0);
    const y = (r) => H - B - (H - B - T) * r / top;
    for (const r of [0, top / 2, top]) {
      g.append(svg('line', {x1: L, x2: W - R, y1: y(r), y2: y(r), stroke: '#e6eaee'}));
      const t = svg('text', {x: L - 4, y: y(r) + 3.5, 'text-anchor': 'end', 'font-size': 9.5, fill: '#5d6b7a'}); t.textContent = num(r, 3); g.append(t);
    }
    const points = b.s_mm.map((s, i) => x(s).toFixed(1) + ',' + y(b.radius_mm[i]).toFixed(1));
    g.append(svg('polygon', {points: `${x(0)},${y(0)} ${points.join(' ')} ${x(b.length_mm)},${y(0)}`, fill: colour, opacity: .35}));
    g.append(svg('polyline', {points: points.join(' '), fill: 'none', stroke: '#3c4a58', 'stroke-width': 1.4}));
    for (const [s, anchor] of [[0, 'start'], [b.length_mm, 'end']]) {
      const t = svg('text', {x: x(s), y: H - 7, 'text-anchor': anchor, 'font-size': 9.5, fill: '#5d6b7a'}); t.textContent = s === 0 ? '0' : num(s, 3) + ' mm'; g.append(t);
    }
    const box = el('div', {}, el('b', {}, b.name), el('span', {class: 'sub'}, b.min_radius_mm === b.max_radius_mm ? `  ${num(b.min_radius_mm, 3)} mm` : `  ${num(b.min_radius_mm, 3)} to ${num(b.max_radius_mm, 3)} mm`), g);
    hot(box, 'wall_' + b.name);
    return box;
  };
  const order = [...facts.branches].sort((a, b) => b.length_mm - a.length_mm);
  const first = 18;
  $('plots').append(...order.slice(0, first).map(panel));
  if (order.length > first) {
    const button = el('button', {class: 'more', style: 'margin-top:12px', onclick: () => { $('plots').append(...order.slice(first).map(panel)); button.remove(); }},
      `Show the ${order.length - first} shorter branches`);
    $('radii').append(button);
  }
  if (!order.length) $('plots').append(el('span', {class: 'sub'}, 'No centerlines are known.'));
})();

