// Charts: tooltips and switches for curves. They are complete without this script.

const NEAR = 40;  // user units within which a point is taken to be meant

function enhanceChart(figure) {
  const plot = figure.querySelector('.plot');
  if (!plot) return;
  const svg = plot.querySelector('svg');
  const points = [...svg.querySelectorAll('.point')].map((element) => {
    const title = element.querySelector('title');
    const says = title.textContent;
    title.remove();  // the browser's own tooltip would cover ours
    return { element, says, x: +element.dataset.x, y: +element.dataset.y, curve: element.closest('.curve') };
  });
  const tip = h('div', { class: 'tip', hidden: true });
  const said = h('p', { class: 'unseen', 'aria-live': 'polite' });
  plot.append(tip, said);
  let shown = null;

  const visible = () => points.filter((point) => !point.curve.classList.contains('off'));
  function show(point, aloud = false) {
    if (shown) shown.element.classList.remove('chosen');
    shown = point;
    tip.hidden = !point;
    if (!point) return;
    point.element.classList.add('chosen');
    const [name, ...lines] = point.says.split('\n');
    tip.replaceChildren(h('strong', {}, name), ...lines.map((line) => h('span', {}, line)));
    const box = plot.getBoundingClientRect(), at = point.element.querySelector('.marker').getBoundingClientRect();
    const x = at.x + at.width / 2 - box.x;
    tip.style.left = `${Math.max(0, Math.min(box.width - tip.offsetWidth, x - tip.offsetWidth / 2))}px`;
    const above = at.y - box.y - tip.offsetHeight - 8;
    tip.style.top = `${above >= 0 ? above : at.bottom - box.y + 8}px`;
    if (aloud) said.textContent = lines.length ? `${name}. ${lines.join(', ')}` : name;
  }

  plot.addEventListener('pointermove', (event) => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const distance = (point) => Math.hypot(point.x - place.x, point.y - place.y);
    const nearest = visible().reduce((a, b) => (a && distance(a) <= distance(b) ? a : b), null);
    show(nearest && distance(nearest) < NEAR ? nearest : null);
  });
  plot.addEventListener('pointerleave', () => show(null));
  plot.addEventListener('blur', () => show(null));
  plot.tabIndex = 0;
  plot.setAttribute('role', 'group');
  plot.setAttribute('aria-label', 'Curves: left and right arrow keys walk along one, up and down change to another');
  plot.addEventListener('keydown', (event) => {
    const curves = [...new Set(visible().map((point) => point.curve))];
    if (!curves.length || event.ctrlKey || event.metaKey || event.altKey) return;
    const of = (curve) => points.filter((point) => point.curve === curve);
    if (event.key === 'Escape') return show(null);
    if (!event.key.startsWith('Arrow')) return;
    event.preventDefault();
    if (!shown) return show(of(curves[0])[0], true);
    const mine = of(shown.curve), k = mine.indexOf(shown);
    const along = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (along) return show(mine[Math.max(0, Math.min(mine.length - 1, k + along))], true);
    const step = event.key === 'ArrowDown' ? 1 : curves.length - 1;
    const next = of(curves[(curves.indexOf(shown.curve) + step) % curves.length]);
    show(next[Math.min(k, next.length - 1)], true);
  });

  for (const item of figure.querySelectorAll('.legend li')) {
    const curve = svg.querySelector(`.curve[data-curve="${item.dataset.curve}"]`);
    const button = h('button', {
      type: 'button',
      'aria-pressed': 'true',
      title: 'Show or hide this curve',
      click: () => {
        const off = curve.classList.toggle('off');
        button.setAttribute('aria-pressed', String(!off));
        show(null);
      },
      pointerenter: () => curve.classList.add('strong'),
      pointerleave: () => curve.classList.remove('strong'),
    }, ...item.childNodes);
    item.append(button);
  }
}

document.querySelectorAll('.chart').forEach(enhanceChart);
