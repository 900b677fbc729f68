// Complaints about the page as it is laid out now, as a list of sentences. Run inside the page by the test; no page holds it.
((width) => {
  const complaints = [];
  const say = (what) => complaints.length < 40 && complaints.push(what);
  const name = (e) => `<${e.tagName.toLowerCase()}> "${(e.textContent || '').trim().slice(0, 40)}"`;
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const shown = (e) => e.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true });

  // Nothing is cut off at the sides.
  const root = document.documentElement;
  if (root.scrollWidth > width) say(`the page is ${root.scrollWidth} wide on a screen of ${width}`);
  const scrolls = (e) => e && (['auto', 'scroll'].includes(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
  for (const e of all('body *')) {
    if (e.ownerSVGElement || !shown(e)) continue;
    const box = e.getBoundingClientRect();
    if (box.width && (box.right > width + 1 || box.left < -1) && !scrolls(e.parentElement)) {
      say(`${name(e)} reaches from ${box.left} to ${box.right} on a screen of ${width}`);
    }
  }

  // Text in pictures stands inside, apart from other text, and is legible.
  for (const svg of all('svg')) {
    if (!shown(svg)) continue;
    const view = svg.viewBox.baseVal;
    const texts = all('text', svg).map((t) => [t, t.getBBox()]);
    for (const [t, b] of texts) {
      if (b.x < view.x - 0.5 || b.y < view.y - 0.5 || b.x + b.width > view.width + 0.5 || b.y + b.height > view.height + 0.5) {
        say(`${name(t)} leaves its picture: ${b.x} to ${b.x + b.width} of ${view.width}`);
      }
      const size = parseFloat(getComputedStyle(t).fontSize) * t.getScreenCTM().a;
      if (size < 9.5 && !matchMedia('print').matches) say(`${name(t)} is ${size.toFixed(1)} px small`);
    }
    texts.forEach(([t, a], i) => texts.slice(i + 1).forEach(([u, b]) => {
      const across = Math.min(a.x + a.width, b.x + b.width) - Math.max(a.x, b.x);
      const down = Math.min(a.y + a.height, b.y + b.height) - Math.max(a.y, b.y);
      if (across > 1 && down > 2) say(`${name(t)} lies over ${name(u)}`);
    }));
  }

  // Everything has a name.
  for (const svg of all('svg')) {
    const said = ['title', 'desc'].map((tag) => svg.querySelector(`:scope > ${tag}`)?.textContent.trim());
    if (svg.getAttribute('role') !== 'img' || !said.every(Boolean)) say(`a picture has no title and description: ${name(svg)}`);
  }
  for (const img of all('img')) if (!img.alt) say(`an image has no alt: ${img.src}`);
  for (const table of all('table')) {
    if (!table.caption?.textContent.trim()) say(`a table has no caption: ${name(table)}`);
    for (const th of all('th', table)) if (!th.scope) say(`${name(th)} has no scope`);
  }
  for (const e of all('[tabindex]')) {
    if (!e.matches('main') && !e.getAttribute('aria-label')) say(`${name(e)} takes the focus and has no name`);
  }
  if (root.lang !== 'en') say('the page has no language');
  if (all('h1').length !== 1) say('there is not one h1');
  for (const landmark of ['main', 'nav', 'header']) if (all(landmark).length !== 1) say(`there is not one <${landmark}>`);
  let level = 0;
  for (const h of all('h1,h2,h3,h4')) {
    const next = Number(h.tagName[1]);
    if (next > level + 1) say(`${name(h)} skips a level`);
    level = next;
  }
  const ids = all('[id]').map((e) => e.id);
  if (new Set(ids).size !== ids.length) say('an id stands there twice');
  for (const a of all('a[href^="#"]')) if (!document.getElementById(a.hash.slice(1))) say(`${name(a)} leads nowhere`);

  // Text stands out from what is behind it by 4.5 to 1.
  const channels = (colour) => {
    const [r, g, b, a = 1] = colour.match(/[\d.]+/g).map(Number);
    return [r, g, b, a];
  };
  const behind = (e) => {
    const layers = [];
    for (; e; e = e.parentElement) layers.push(channels(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((below, [r, g, b, a]) => [r, g, b].map((c, i) => a * c + (1 - a) * below[i]), [255, 255, 255]);
  };
  const light = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  for (const e of all('body *')) {
    if (e.ownerSVGElement || !shown(e) || ![...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())) continue;
    const [a, b] = [light(channels(getComputedStyle(e).color)), light(behind(e))].sort((x, y) => y - x);
    if ((a + 0.05) / (b + 0.05) < 4.5) say(`${name(e)} has a contrast of ${((a + 0.05) / (b + 0.05)).toFixed(1)}`);
  }
  return complaints;
})
