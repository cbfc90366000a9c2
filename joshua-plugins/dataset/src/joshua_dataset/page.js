const COLOURS = ['#1f77b4','#ff7f0e','#2ca02c','#d62728','#9467bd','#8c564b','#e377c2','#7f7f7f','#bcbd22','#17becf'];
function draw(canvas, curve, at) {
  const scale = window.devicePixelRatio || 1, w = canvas.clientWidth * scale, h = canvas.clientHeight * scale;
  canvas.width = w; canvas.height = h;
  const c = canvas.getContext('2d'), pad = 44 * scale, t = curve.time_s, end = t[t.length - 1] || 1;
  let low = Infinity, high = -Infinity;
  for (const row of curve.values) for (const v of row) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(high > low)) { low -= 1; high += 1; }
  const x = s => pad + (w - pad - 4) * s / end, y = v => 6 + (h - 24 * scale) * (high - v) / (high - low);
  c.font = `${11 * scale}px system-ui`; c.fillStyle = '#8a94a3';
  for (const part of [0, .5, 1]) {
    const v = low + (high - low) * part;
    c.fillText(Math.abs(v) < (high - low) / 1000 ? '0' : v.toPrecision(3), 0, y(v) + 4); c.fillRect(pad, y(v), w - pad, 1);
    c.fillText((end * part).toFixed(1) + ' s', Math.min(x(end * part), w - 40 * scale), h - 2);
  }
  curve.names.forEach((_, i) => {
    c.strokeStyle = COLOURS[i % COLOURS.length]; c.lineWidth = 1.4 * scale; c.beginPath();
    curve.values.forEach((row, k) => k ? c.lineTo(x(t[k]), y(row[i])) : c.moveTo(x(t[k]), y(row[i])));
    c.stroke();
  });
  c.fillStyle = '#d62728'; c.fillRect(x(at), 0, 1.5 * scale, h - 16 * scale);
}
for (const section of document.querySelectorAll('section[data-episode]')) {
  const curves = JSON.parse(section.querySelector('script').textContent);
  const canvases = [...section.querySelectorAll('canvas')], videos = [...section.querySelectorAll('video')];
  const slider = section.querySelector('input'), label = section.querySelector('output');
  const end = Number(slider.max);
  function show(at, from) {
    slider.value = at; label.textContent = Number(at).toFixed(2) + ' s';
    canvases.forEach((canvas, i) => draw(canvas, curves[i], at));
    for (const video of videos) if (video !== from && Math.abs(video.currentTime - at) > .05) video.currentTime = at;
  }
  slider.addEventListener('input', () => show(Number(slider.value), null));
  for (const video of videos) {
    video.addEventListener('timeupdate', () => { if (!video.paused) show(Math.min(video.currentTime, end), video); });
    video.addEventListener('play', () => videos.forEach(other => other !== video && other.play()));
    video.addEventListener('pause', () => videos.forEach(other => other !== video && other.pause()));
  }
  for (const canvas of canvases) canvas.addEventListener('click', event => {
    const box = canvas.getBoundingClientRect();
    show(Math.max(0, Math.min(end, end * (event.clientX - box.left - 44) / (box.width - 48))), null);
  });
  show(0, null);
  window.addEventListener('resize', () => show(Number(slider.value), null));
}
