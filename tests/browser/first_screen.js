// Words that stand in the first screen, as a list. Run inside the page by the test; no page holds it.
(() => {
  const words = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode;
    const e = node.parentElement;
    if (e.closest('svg, nav, .skip, style') || !e.checkVisibility({ visibilityProperty: true })) continue;
    for (const found of node.data.matchAll(/\S+/g)) {
      const range = document.createRange();
      range.setStart(node, found.index);
      range.setEnd(node, found.index + found[0].length);
      if (range.getBoundingClientRect().top < innerHeight && /[\p{L}\p{N}]/u.test(found[0])) words.push(found[0]);
    }
  }
  return words;
})()
