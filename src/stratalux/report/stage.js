// The stage: canvases that are zoomed and moved together, the divider of a split, and the pixel that is pointed at.

const LARGEST_PIXEL = 96;    // CSS pixels, of one of the image's
const PIXEL_WITH_TEXT = 58;  // from this size on, pixels show their values
const SWIPE = 60;            // CSS pixels

class Stage {
  /**
   * `owner` is asked for what is drawn (`layer`, `shownValues`), whether it has the user's attention (`attentive`), and
   * is told what the user does (`choose`, `flip`) and that all is drawn (`drawn`).
   */
  constructor(width, height, owner) {
    Object.assign(this, { width, height, owner });
    this.zoom = 1;        // 1: all is seen
    this.x = width / 2;   // in the middle of a pane, in pixels of the image
    this.y = height / 2;
    this.split = 0.5;
    this.against = null;  // picture on the right of the divider
    this.large = false;
    this.panes = [];
    this.pointers = new Map();
    this.probe = null;    // the pixel that is pointed at, and in which picture
    this.hint = h('p', { class: 'hint', 'aria-hidden': 'true' }, 'Click first, or hold Ctrl, to zoom with the wheel');
    this.divider = h('div', {
      class: 'divider', role: 'slider', tabindex: 0, 'aria-label': 'Where the picture is split',
      'aria-orientation': 'horizontal', 'aria-valuemin': 0, 'aria-valuemax': 100,
      keydown: (event) => this.moveDivider(event),
    });
    this.element = h('div',
      { class: 'stage', tabindex: 0, role: 'group', 'aria-label': 'Picture, moved and zoomed by keys' },
      this.divider, this.hint);
    this.listen();
    new ResizeObserver(() => this.changed()).observe(this.element);
  }

  /** Show pictures `ks`, each in a pane, of which `current` is marked; with `against` on the right of the divider. */
  show(ks, names, current, against) {
    this.against = against;
    this.divider.hidden = against === null;
    while (this.panes.length > ks.length) this.panes.pop().element.remove();
    while (this.panes.length < ks.length) {
      const canvas = h('canvas', { role: 'img' });
      const left = h('span', { class: 'name' }), right = h('span', { class: 'name right' });
      const element = h('div', { class: 'pane' }, canvas, left, right);
      this.element.insertBefore(element, this.divider);
      this.panes.push({ element, canvas, context: canvas.getContext('2d'), left, right, k: 0 });
    }
    this.panes.forEach((pane, place) => {
      pane.k = ks[place];
      pane.element.classList.toggle('current', ks.length > 1 && pane.k === current);
      const name = names[pane.k], other = against === null ? '' : names[against];
      pane.left.textContent = name;
      pane.right.textContent = other;
      pane.canvas.setAttribute('aria-label', other ? `${name} on the left, ${other} on the right` : name);
    });
    this.changed();
  }

  // ---- drawing ------------------------------------------------------------------------------------------------------

  /** Draw at the next frame, once. */
  changed() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (!this.element.clientWidth) return;  // not visible; the observer tells when it is
      this.arrange();
      this.panes.forEach((pane) => this.draw(pane));
      this.owner.drawn();
    });
  }

  /** Sizes of the panes and their canvases: as large as the place allows, in the shape of the image. */
  arrange() {
    const { width, height } = this;
    const count = this.panes.length;
    const wide = this.element.clientWidth;
    const high = this.large ? this.element.clientHeight : Infinity;
    let columns = 1;
    if (count > 1) {
      // As few columns as let all be seen at once; never so many that nothing is recognised.
      const tall = (n) => Math.ceil(count / n) * (wide / n) * height / width;
      while (columns < count && tall(columns) > Math.min(high, innerHeight * 0.9)) columns += 1;
      if (!this.large) columns = Math.max(1, Math.min(columns, Math.floor(wide / 160)));
    }
    this.element.style.setProperty('--columns', columns);
    const rows = Math.ceil(count / columns);
    const paneWidth = (wide - 2 * (columns - 1)) / columns;
    const paneHeight = this.large ? (high - 2 * (rows - 1)) / rows
      : Math.min(paneWidth * height / width, Math.max(240, innerHeight * 0.75));
    const ratio = devicePixelRatio || 1;
    for (const { canvas } of this.panes) {
      canvas.style.height = `${paneHeight}px`;
      const size = [Math.round(paneWidth * ratio), Math.round(paneHeight * ratio)];
      // Setting a canvas's size clears it, so it is done only when needed.
      if (canvas.width !== size[0]) canvas.width = size[0];
      if (canvas.height !== size[1]) canvas.height = size[1];
    }
    this.keepInside();
    this.divider.style.left = `${100 * this.split}%`;
    this.divider.setAttribute('aria-valuenow', Math.round(100 * this.split));
    // As long as all is seen, a finger scrolls the page.
    this.element.style.touchAction = this.zoom > 1 || this.large ? 'none' : 'pan-y';
  }

  /** Device pixels of one of the image's. */
  scale({ canvas }) {
    return this.fitting(canvas) * this.zoom;
  }

  /** The scale at which all of the image is just seen. */
  fitting(canvas) {
    return Math.min(canvas.width / this.width, canvas.height / this.height);
  }

  largestZoom(canvas) {
    return Math.max(1, LARGEST_PIXEL * (devicePixelRatio || 1) / this.fitting(canvas));
  }

  /** Nothing is shown beyond the image, except where it is smaller than its pane. */
  keepInside() {
    const { canvas } = this.panes[0];
    this.zoom = clamp(this.zoom, 1, this.largestZoom(canvas));
    const scale = this.scale(this.panes[0]);
    const inside = (centre, size, room) => (room / scale >= size ? size / 2
      : clamp(centre, room / 2 / scale, size - room / 2 / scale));
    this.x = inside(this.x, this.width, canvas.width);
    this.y = inside(this.y, this.height, canvas.height);
  }

  /** Device pixel of the canvas at which the image begins. */
  origin({ canvas }, scale) {
    return [Math.round(canvas.width / 2 - this.x * scale), Math.round(canvas.height / 2 - this.y * scale)];
  }

  draw(pane) {
    const { canvas, context } = pane;
    const scale = this.scale(pane), [x, y] = this.origin(pane, scale);
    const paint = (k) => {
      context.drawImage(this.owner.layer(k), x, y, this.width * scale, this.height * scale);
      if (scale >= PIXEL_WITH_TEXT * (devicePixelRatio || 1)) this.drawValues(pane, k, scale, x, y);
    };
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = scale < 1;
    context.imageSmoothingQuality = 'high';
    paint(pane.k);
    if (this.against !== null) {
      const edge = Math.round(this.split * canvas.width);
      context.save();
      context.beginPath();
      context.rect(edge, 0, canvas.width - edge, canvas.height);
      context.clip();
      context.clearRect(edge, 0, canvas.width - edge, canvas.height);
      paint(this.against);
      context.restore();
    }
    if (this.probe && this.probe.marked) this.drawProbe(context, scale, x, y);
  }

  /** A frame around the pixel that a finger points at, and hides. */
  drawProbe(context, scale, x, y) {
    const size = Math.max(scale, 7);
    const left = x + (this.probe.x + 0.5) * scale - size / 2, top = y + (this.probe.y + 0.5) * scale - size / 2;
    for (const [grow, colour] of [[1, '#000'], [0, '#fff']]) {
      context.strokeStyle = colour;
      context.strokeRect(left - grow, top - grow, size + 2 * grow, size + 2 * grow);
    }
  }

  /** Numbers on the pixels, which are large enough for them. */
  drawValues({ canvas, context }, k, scale, x, y) {
    const { width, height } = this;
    const step = scale / 4.4;
    context.font = `${Math.round(step * 0.82)}px ui-monospace, monospace`;
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.lineWidth = 3;
    context.strokeStyle = '#000b';
    context.fillStyle = '#fff';
    const [firstRow, firstColumn] = [y, x].map((origin) => Math.max(0, Math.floor(-origin / scale)));
    const endRow = Math.min(height, (canvas.height - y) / scale);
    const endColumn = Math.min(width, (canvas.width - x) / scale);
    for (let row = firstRow; row < endRow; row++) {
      for (let column = firstColumn; column < endColumn; column++) {
        const lines = this.owner.shownValues(k, row * width + column).map(digits);
        lines.forEach((line, n) => {
          const place = [x + (column + 0.5) * scale, y + (row + 0.5) * scale + (n - (lines.length - 1) / 2) * step];
          context.strokeText(line, ...place);
          context.fillText(line, ...place);
        });
      }
    }
  }

  // ---- zooming and moving -------------------------------------------------------------------------------------------

  /** Zoom by `factor`; what is at `at`, in device pixels of the canvas of `pane`, stays there. */
  zoomBy(factor, pane = this.panes[0], at = [pane.canvas.width / 2, pane.canvas.height / 2]) {
    const from = [at[0] - pane.canvas.width / 2, at[1] - pane.canvas.height / 2];
    const before = this.scale(pane);
    this.zoom = clamp(this.zoom * factor, 1, this.largestZoom(pane.canvas));
    const after = this.scale(pane);
    this.x += from[0] / before - from[0] / after;
    this.y += from[1] / before - from[1] / after;
    this.changed();
  }

  /** Move the image by device pixels. */
  moveBy(x, y, pane = this.panes[0]) {
    this.x -= x / this.scale(pane);
    this.y -= y / this.scale(pane);
    this.changed();
  }

  fit() {
    this.zoom = 1;
    this.changed();
  }

  /** Zoom to a rectangle. */
  look(crop) {
    const { canvas } = this.panes[0];
    const scale = Math.min(canvas.width / (crop.right - crop.left), canvas.height / (crop.bottom - crop.top));
    this.zoom = scale / this.fitting(canvas);
    this.x = (crop.left + crop.right) / 2;
    this.y = (crop.top + crop.bottom) / 2;
    this.changed();
  }

  // ---- pointer and wheel --------------------------------------------------------------------------------------------

  /** The pane under an event, the place in its canvas in device pixels, and the pixel of the image there. */
  placeOf(event) {
    const inside = (pane) => {
      const box = pane.canvas.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left, event.clientY - box.top];
      return x >= 0 && x < box.width && y >= 0 && y < box.height;
    };
    const pane = this.panes.find(inside) ?? this.panes[0];
    const box = pane.canvas.getBoundingClientRect();
    const ratio = pane.canvas.width / box.width;
    const at = [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
    const scale = this.scale(pane), [x, y] = this.origin(pane, scale);
    return { pane, at, ratio, x: Math.floor((at[0] - x) / scale), y: Math.floor((at[1] - y) / scale) };
  }

  probeAt(event) {
    const { pane, x, y } = this.placeOf(event);
    const inside = x >= 0 && y >= 0 && x < this.width && y < this.height;
    this.probe = inside ? { x, y, k: pane.k, marked: event.pointerType === 'touch' } : null;
  }

  listen() {
    const stage = this.element;
    stage.addEventListener('pointerdown', (event) => this.pointerDown(event));
    stage.addEventListener('pointermove', (event) => this.pointerMove(event));
    for (const end of ['pointerup', 'pointercancel']) stage.addEventListener(end, (event) => this.pointerUp(event));
    stage.addEventListener('pointerleave', (event) => {
      if (event.pointerType === 'touch') return;  // what was touched stays marked
      this.probe = null;
      this.changed();
    });
    stage.addEventListener('dblclick', () => this.fit());
    stage.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && !this.owner.attentive) {
        // The page scrolls on; whoever wants to zoom is told how.
        this.hint.classList.add('seen');
        clearTimeout(this.hintTimer);
        this.hintTimer = setTimeout(() => this.hint.classList.remove('seen'), 1500);
        return;
      }
      event.preventDefault();
      const { pane, at } = this.placeOf(event);
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
      this.zoomBy(2 ** (-clamp(event.deltaY * lines, -200, 200) / 200), pane, at);
    }, { passive: false });
  }

  pointerDown(event) {
    if (event.button !== 0) return;
    const dividing = event.target === this.divider;
    event.target.setPointerCapture?.(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, from: event.clientX, dividing });
    this.pinched = this.pointers.size > 1;
    this.probeAt(event);
    if (this.panes.length > 1 && this.probe) this.owner.choose(this.probe.k);
    this.changed();
  }

  pointerMove(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) {
      this.probeAt(event);
      return this.changed();
    }
    const moved = [event.clientX - pointer.x, event.clientY - pointer.y];
    const { pane, ratio } = this.placeOf(event);
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, other]) => other);
    if (pointer.dividing) {
      const box = this.element.getBoundingClientRect();
      this.split = clamp((event.clientX - box.left) / box.width, 0, 1);
    } else if (others.length) {
      const distance = (point) => Math.hypot(point.x - others[0].x, point.y - others[0].y);
      const now = { x: event.clientX, y: event.clientY };
      const middle = { clientX: (now.x + others[0].x) / 2, clientY: (now.y + others[0].y) / 2 };
      this.moveBy(moved[0] * ratio / 2, moved[1] * ratio / 2, pane);
      this.zoomBy(distance(now) / Math.max(1, distance(pointer)), pane, this.placeOf(middle).at);
    } else if (this.zoom > 1) {
      this.moveBy(moved[0] * ratio, moved[1] * ratio, pane);
    }
    Object.assign(pointer, { x: event.clientX, y: event.clientY });
    this.probeAt(event);
    this.changed();
  }

  pointerUp(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!pointer || event.type === 'pointercancel' || event.pointerType !== 'touch') return;
    const swiped = event.clientX - pointer.from;
    const alone = this.panes.length === 1 && this.against === null;
    if (alone && this.zoom === 1 && !this.pinched && Math.abs(swiped) > SWIPE) this.owner.flip(swiped < 0 ? 1 : -1);
  }

  moveDivider(event) {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (!step || event.shiftKey) return;
    event.preventDefault();
    event.stopPropagation();
    this.split = clamp(this.split + step, 0, 1);
    this.changed();
  }
}
