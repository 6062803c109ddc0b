// ---- projections of the image, if there was one ----
for (const image of facts.images) {
  const data = Uint8Array.from(atob(image.grey), (c) => c.charCodeAt(0));
  const shot = el('canvas', {class: 'grey', width: image.width, height: image.height});
  shot.style.aspectRatio = `${image.width * image.pixel_mm[0]} / ${image.height * image.pixel_mm[1]}`;
  const c = shot.getContext('2d');
  const pixels = c.createImageData(image.width, image.height);
  for (let i = 0; i < data.length; ++i) { pixels.data.set([data[i], data[i], data[i], 255], 4 * i); }
  c.putImageData(pixels, 0, 0);
  c.strokeStyle = '#ff5a4f'; c.lineWidth = Math.max(0.6, image.width / 420); c.lineJoin = 'round';
  for (const path of image.lines) {
    c.beginPath();
    path.forEach(([x, y], k) => k ? c.lineTo(x + 0.5, y + 0.5) : c.moveTo(x + 0.5, y + 0.5));
    c.stroke();
  }
  $('shots').append(el('figure', {}, shot, image.title));
}
