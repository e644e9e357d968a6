"""JavaScript functions that find layout and contrast faults of a page."""

LOOKS = [("dark", 390), ("dark", 1280), ("light", 1280), ("light", 390)]
"""Colour schemes, and widths in pixels of a telephone and of a screen."""

COVERED = """() => {
  const all = [...document.querySelectorAll("button, input, select, canvas, p, h1, h2, li, td")];
  const seen = all.filter((one) => one.checkVisibility() && !one.closest("#lines, .under"));
  const shown = (one) => { // without what is scrolled out of sight
    let { left, right, top, bottom } = one.getBoundingClientRect();
    for (let up = one.parentElement; up !== document.body; up = up.parentElement) {
      if (getComputedStyle(up).overflow === "visible") continue;
      const frame = up.getBoundingClientRect();
      left = Math.max(left, frame.left), right = Math.min(right, frame.right);
      top = Math.max(top, frame.top), bottom = Math.min(bottom, frame.bottom);
    }
    return { left, right, top, bottom };
  };
  const boxes = seen.map(shown);
  const meet = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  const found = [];
  seen.forEach((one, i) => seen.slice(i + 1).forEach((other, j) => {
    if (one.contains(other) || !meet(boxes[i], boxes[i + 1 + j])) return;
    found.push(`${one.outerHTML.slice(0, 60)} and ${other.outerHTML.slice(0, 60)}`);
  }));
  return found;
}"""
"""Lists elements that overlap."""

PALE = """() => {
  const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
  const light = (colour) => numbers(colour).slice(0, 3).reduce((sum, part, i) => {
    const share = part / 255;
    const linear = share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
    return sum + [0.2126, 0.7152, 0.0722][i] * linear;
  }, 0.05);
  const ground = (one) => {
    const colour = getComputedStyle(one).backgroundColor;
    return numbers(colour)[3] === 0 ? ground(one.parentElement) : colour;
  };
  const own = (one) => [...one.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  return [...document.body.querySelectorAll("*")]
    .filter((one) => own(one) && one.checkVisibility() && !one.matches("option, :disabled"))
    .map((one) => [one, light(getComputedStyle(one).color), light(ground(one))])
    .filter(([, a, b]) => Math.max(a, b) / Math.min(a, b) < 4.5)
    .map(([one]) => one.outerHTML.slice(0, 80));
}"""
"""Lists text with less contrast than WCAG 2.2, 1.4.3, requires."""
