// What the page's other scripts share, tables that sort, and the section that is on screen, in the navigation.

/** An element with attributes, listeners (functions) and children. */
function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === 'function') element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, '');
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Columns sort by a click on their heads: numbers by value, what is no number last. */
function enhanceTable(table) {
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  if (body.rows.length < 3) return;
  heads.forEach((head, column) => {
    const button = h('button', {
      type: 'button',
      click: () => {
        const up = head.getAttribute('aria-sort') !== 'ascending';
        heads.forEach((other) => other.removeAttribute('aria-sort'));
        head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
        const numeric = head.classList.contains('number');
        const key = (row) => row.cells[column].textContent.trim();
        const value = (row) => parseFloat(key(row).replace('−', '-').replace(/,/g, ''));
        const rows = [...body.rows].sort((a, b) => {
          if (!numeric) return (up ? 1 : -1) * key(a).localeCompare(key(b));
          const [x, y] = [value(a), value(b)];
          if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);
          return up ? x - y : y - x;
        });
        body.append(...rows);
      },
    }, ...head.childNodes);
    head.append(button);
  });
}

function followSections() {
  const links = new Map([...document.querySelectorAll('.contents a')].map((a) => [a.hash.slice(1), a]));
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const link = links.get(target.id);
      if (isIntersecting) link?.setAttribute('aria-current', 'true');
      else link?.removeAttribute('aria-current');
    }
  }, { rootMargin: '-20% 0px -75% 0px' });
  document.querySelectorAll('.part').forEach((part) => seen.observe(part));
}

document.querySelectorAll('.sortable').forEach(enhanceTable);
followSections();
