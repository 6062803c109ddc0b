'use strict';
const facts = JSON.parse(document.getElementById('facts').textContent);
const $ = (id) => document.getElementById(id);
const el = (tag, props = {}, ...children) => {
  const e = document.createElement(tag);
  for (const [k, v] of Object.entries(props)) k === 'class' ? e.className = v : e[k] = v;
  e.append(...children);
  return e;
};
const svg = (tag, props) => {
  const e = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [k, v] of Object.entries(props)) e.setAttribute(k, v);
  return e;
};
// Four significant digits; tiny numbers as powers of ten.
const num = (x, digits = 4) => {
  if (x === null || x === undefined) return '–';
  if (typeof x !== 'number') return String(x);
  if (x === 0 || Number.isInteger(x)) return String(x);
  const a = Math.abs(x);
  if (a < 1e-3 || a >= 1e6) return x.toExponential(2).replace('e-', '·10⁻').replace('e+', '·10')
      .replace(/⁻(\d+)$/, (_, d) => '⁻' + [...d].map((c) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]).join(''))
      .replace(/10(\d+)$/, (_, d) => '10' + [...d].map((c) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]).join(''));
  return String(Number(x.toPrecision(digits)));
};

// ---- words, figures, tables ----
document.title = facts.name || 'Angiospline report';
$('name').textContent = facts.name || 'Vessel model';
$('source').textContent = facts.source ? 'from ' + facts.source : '';
const certificate = facts.certificate;
const chip = (text, good) => el('span', {class: 'chip ' + (good === null ? '' : good ? 'good' : 'bad')}, text);
if (certificate) {
  $('chips').append(chip(certificate.closed ? 'closed' : 'open', certificate.closed), ' ',
      chip(certificate.valid ? 'valid' : 'not valid', certificate.valid), ' ',
      chip(certificate.self_intersecting ? 'self-intersecting' : 'no self-intersection', !certificate.self_intersecting));
}
if (facts.failed.length) $('chips').append(' ', chip(facts.failed.length + ' failed', false));
const box = facts.bounding_box_mm;
const size = box[1].map((x, i) => x - box[0][i]);
for (const [value, unit, label] of [
  [facts.summary.branches, '', 'branches'], [facts.summary.junctions, '', 'junctions'], [facts.summary.loops, '', 'loops'],
  [facts.summary.inlets + ' / ' + facts.summary.outlets, '', 'inlets / outlets'],
  [num(facts.summary.length_mm), ' mm', 'centerline length'],
  [num(certificate ? certificate.volume_mm3 : facts.mesh.volume_mm3), ' mm³', 'volume'],
  [num(certificate ? certificate.area_mm2 : facts.mesh.area_mm2), ' mm²', 'surface area'],
  [facts.summary.patches, '', 'NURBS patches'],
  [size.map((x) => x < 10 ? num(x, 2) : String(Math.round(x))).join(' × '), '', 'bounding box, mm'],
]) $('figures').append(el('div', {class: 'figure'}, el('b', {style: String(value).length > 9 ? 'font-size:14px;line-height:25px' : ''}, value + unit), el('span', {}, label)));

function table(target, columns, rows, onRow) {
  if (!rows.length) { target.append(el('span', {class: 'sub'}, 'None.')); return; }
  const body = el('tbody');
  const fill = (list) => body.replaceChildren(...list.map((row) => {
    const tr = el('tr', {}, ...columns.map(([, key, kind]) => el('td', {class: kind === 'n' ? 'n' : ''},
        kind === 'n' ? num(row[key]) : row[key] instanceof Node ? row[key] : String(row[key] ?? '–'))));
    if (onRow) onRow(tr, row);
    return tr;
  }));
  let last = null, up = true;
  const head = el('tr', {}, ...columns.map(([title, key, kind]) => el('th', {class: kind === 'n' ? 'n' : '', title: 'Sort',
    onclick: () => {
      up = last === key ? !up : true; last = key;
      const of = (r) => r[key] instanceof Node ? r[key].textContent : r[key];
      fill([...rows].sort((a, b) => (up ? 1 : -1) * (kind === 'n' ? (of(a) ?? -Infinity) - (of(b) ?? -Infinity)
          : String(of(a)).localeCompare(String(of(b)), undefined, {numeric: true}))));
    }}, title)));
  fill(rows);
  target.append(el('table', {}, el('thead', {}, head), body));
}
const swatch = (name) => {
  const f = facts.faces.find((face) => face.name === name);
  const s = el('span', {}, el('i', {style: 'display:inline-block;width:10px;height:10px;border-radius:3px;margin-right:7px;background:' + (f ? f.colour : '#ccc')}), name);
  return s;
};
const hot = (tr, name) => {
  const k = facts.faces.findIndex((f) => f.name === name);
  if (k < 0) return;
  tr.onmouseenter = () => highlight(k);
  tr.onmouseleave = () => highlight(-1);
};
table($('branches'), [['Branch', 'label'], ['From', 'from'], ['To', 'to'], ['Length mm', 'length_mm', 'n'], ['Mean radius mm', 'mean_radius_mm', 'n'],
  ['Least mm', 'min_radius_mm', 'n'], ['Largest mm', 'max_radius_mm', 'n'], ['Wall mm²', 'area_mm2', 'n']],
  facts.branches.map((b) => ({...b, label: swatch('wall_' + b.name)})), (tr, b) => hot(tr, 'wall_' + b.name));
table($('junctions'), [['Junction', 'label'], ['Branches', 'list'], ['Degree', 'degree', 'n'], ['Wall mm²', 'area_mm2', 'n']],
  facts.junctions.map((j) => ({...j, label: swatch('junction_' + j.name), list: j.branches.join(', ')})), (tr, j) => hot(tr, 'junction_' + j.name));
table($('faces'), [['Face', 'label'], ['Kind', 'kind'], ['Area mm²', 'area_mm2', 'n'], ['Triangles here', 'triangles', 'n']],
  facts.faces.map((f) => ({...f, label: swatch(f.name)})), (tr, f) => hot(tr, f.name));
if (certificate) {
  const c = certificate;
  const pair = (p) => p && p.length && p[0] ? p.join(' – ') : '';
  const rows = [['Solids', c.solids, null], ['Closed', c.closed, c.closed], ['Valid', c.valid, c.valid],
    ['Self-intersecting', c.self_intersecting, !c.self_intersecting], ['Free edges', c.free_edges, c.free_edges === 0],
    ['Largest gap on a shared edge', num(c.max_gap_mm) + ' mm', null],
    ['Largest angle between neighbouring walls', num(c.max_normal_angle_deg) + '°', c.max_normal_angle_deg <= 0.01, pair(c.worst_edge)],
    ['Smooth edges measured', c.smooth_edges, null], ['Least Jacobian ratio', num(c.min_jacobian_ratio), c.min_jacobian_ratio > 0, c.min_jacobian_face],
    ['Largest curvature × radius', num(c.max_curvature_times_radius), null, c.max_curvature_face],
    ['Genus', num(c.genus), null], ['Volume', num(c.volume_mm3, 8) + ' mm³', null], ['Area', num(c.area_mm2, 8) + ' mm²', null]];
  const t = el('table');
  for (const [what, value, good, where] of rows) t.append(el('tr', {}, el('td', {}, what),
      el('td', {}, good === null ? String(value) : chip(typeof value === 'boolean' ? (value ? 'yes' : 'no') : String(value), good)),
      el('td', {class: 'sub'}, where || '')));
  $('certificate').append(t);
} else $('certificate').append(el('span', {class: 'sub'}, 'The model was not measured.'));
const list = (title, items) => { if (items.length) $('notes').append(el('p', {}, el('b', {}, title)), el('ul', {}, ...items.map((t) => el('li', {}, t)))); };
list('Could not be modelled', facts.failed.map((f) => f.name + ': ' + f.why));
list('Warnings', facts.warnings);
list('Assumptions', facts.assumptions);
list('Time', Object.entries(facts.seconds).map(([k, v]) => k + ': ' + num(v, 3) + ' s'));
list('Files', facts.files);
if (!$('notes').children.length) $('notes').append(el('span', {class: 'sub'}, 'Nothing to note.'));
$('foot').textContent = `Angiospline ${facts.version}. Lengths in millimetres; x to the patient's left, y to the back, z to the head. ` +
  `This page shows ${facts.mesh.triangles.toLocaleString('en')} triangles; figures of the certificate are those of the exact surfaces.`;

