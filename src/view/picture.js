// One side of the stage: its picture arrives as tiles and is drawn as they come, coarse ones first.
View.Side = function (canvas, palette) {
  this.canvas = canvas, this.palette = palette;
  this.draw = canvas.getContext('2d', { willReadFrequently: true });
  this.spare = document.createElement('canvas');
  this.running = null;
  this.moving = 120; // ms that a coarse frame took, smoothed
  this.stride = 3;
  this.result = null;
};
View.Side.prototype = {
  resize: function (width, height) {
    if (this.canvas.width === width && this.canvas.height === height) { return; }
    this.canvas.width = width, this.canvas.height = height;
    View.$('stage').style.setProperty('--ratio', width / height);
  },
  stop: function () { if (this.running) { this.running.abort(); } this.running = null; },
  colour: function (rgba, value, low, high) {
    var p = this.palette, steps = p.length / 3 - 1, span = high > low ? high - low : 1;
    for (var i = 0; i < value.length; i++) {
      if (value[i] !== value[i]) { rgba.set([120, 120, 120, 255], 4 * i); continue; }
      var k = 3 * Math.round(steps * Math.max(0, Math.min(1, (value[i] - low) / span)));
      rgba[4 * i] = p[k], rgba[4 * i + 1] = p[k + 1], rgba[4 * i + 2] = p[k + 2], rgba[4 * i + 3] = 255;
    }
  },
  tile: function (t) {
    var rgba = t.rgba, self = this;
    if (t.value) {
      t.value.forEach(function (v) {
        if (v === v) { self.low = Math.min(self.low, v), self.high = Math.max(self.high, v); }
      });
      rgba = new Uint8ClampedArray(rgba.length);
      this.colour(rgba, t.value, this.low < this.high ? this.low : 0, this.high);
      if (t.stride === 1) { this.keep(t); }
    }
    var image = new ImageData(rgba, t.across, t.down);
    if (t.stride === 1) { this.draw.putImageData(image, t.x, t.y); return; }
    this.spare.width = t.across, this.spare.height = t.down;
    this.spare.getContext('2d').putImageData(image, 0, 0);
    this.draw.imageSmoothingEnabled = false;
    this.draw.drawImage(this.spare, t.x, t.y, t.across * t.stride, t.down * t.stride);
  },
  keep: function (t) {
    var w = this.canvas.width;
    if (!this.values) { this.values = new Float32Array(w * this.canvas.height).fill(NaN); }
    for (var y = 0; y < t.down; y++) { this.values.set(t.value.subarray(y * t.across, (y + 1) * t.across), (t.y + y) * w + t.x); }
  },
  // All tiles with the scale that came out at the end.
  recolour: function (end) {
    if (!this.values || end.low === undefined) { return; }
    var w = this.canvas.width, h = this.canvas.height, image = this.draw.getImageData(0, 0, w, h), x = this.window;
    var own = new Uint8ClampedArray(4 * w * h);
    this.colour(own, this.values, end.low, end.high);
    for (var i = 0; i < w * h; i++) {
      var inside = !x || (i % w >= x[0] && i % w < x[0] + x[2] && i / w >= x[1] && Math.floor(i / w) < x[1] + x[3]);
      if (inside) { image.data.set(own.subarray(4 * i, 4 * i + 4), 4 * i); }
    }
    this.draw.putImageData(image, 0, 0);
  },
  // asked: of /picture. done gets what was counted.
  show: function (asked, size, done) {
    this.stop();
    var self = this, abort = this.running = new AbortController(), start = performance.now();
    this.values = null, this.low = Infinity, this.high = -Infinity;
    this.window = asked.window ? asked.window.split(',').map(Number) : null;
    return View.ask('/picture', asked, abort.signal).then(function (r) {
      if (self.running !== abort) { return; }
      self.resize(size[0], size[1]);
      if (self.window) { self.dim(); }
      return self.read(r.body.getReader(), abort);
    }).then(function (end) {
      if (!end || self.running !== abort) { return; }
      self.running = null;
      if (end.error) { throw new Error(end.error); }
      self.recolour(end);
      self.result = end;
      end.elapsed = performance.now() - start;
      done(end);
    });
  },
  dim: function () {
    this.draw.fillStyle = '#777';
    this.draw.fillRect(0, 0, this.canvas.width, this.canvas.height);
  },
  read: function (reader, abort) {
    var self = this, rest = new Uint8Array(0), end = null;
    function eat() {
      for (;;) {
        if (rest.length < 32) { return; }
        var head = new DataView(rest.buffer, rest.byteOffset, 32), h = [];
        for (var i = 0; i < 6; i++) { h.push(head.getUint32(4 * i, true)); }
        var n = h[2] * h[3], size = n ? 4 * n * (1 + h[5]) : h[3];
        if (rest.length < 32 + size) { return; }
        var body = rest.slice(32, 32 + size);
        rest = rest.subarray(32 + size);
        if (!n) { end = JSON.parse(new TextDecoder().decode(body)); continue; }
        self.tile({
          x: h[0], y: h[1], across: h[2], down: h[3], stride: h[4], rgba: new Uint8ClampedArray(body.buffer, 0, 4 * n),
          value: h[5] ? new Float32Array(body.buffer, 4 * n, n) : null
        });
      }
    }
    function more() {
      return reader.read().then(function (part) {
        if (self.running !== abort) { reader.cancel().catch(function () {}); return null; }
        if (part.done) { return end; }
        var joined = new Uint8Array(rest.length + part.value.length);
        joined.set(rest), joined.set(part.value, rest.length);
        rest = joined;
        eat();
        return more();
      });
    }
    return more();
  },
  // Frames while moving take about a twentieth of a second.
  adapt: function (ms) {
    this.moving = 0.6 * this.moving + 0.4 * ms;
    if (this.moving > 55 && this.stride < 12) { this.stride++, this.moving = 45; }
    if (this.moving < 25 && this.stride > 1) { this.stride--, this.moving = 40; }
  }
};
