// A camera that is turned, shifted and brought nearer. Its text is what the program and sim_render read: W,H,FX,FY,CX,CY,
// then its pose row by row (x right, y up, looking along -z), then its lens.
View.Camera = function (text, scene) {
  var n = text.split(',').map(Number);
  this.text = text;
  this.width = n[0], this.height = n[1], this.f = n.slice(2, 4), this.c = n.slice(4, 6);
  this.pose = n.slice(6, 18), this.lens = n.slice(18);
  this.up = scene.forward_facing ? [0, 1, 0] : [0, 0, 1];
  var back = this.axis(2), at = this.axis(3), depth = 0;
  for (var i = 0; i < 3; i++) { depth += (at[i] - scene.middle[i]) * back[i]; }
  this.distance = scene.forward_facing ? 4 * scene.near : Math.max(depth, 0.05);
};
View.Camera.prototype = {
  axis: function (k) { return [this.pose[k], this.pose[4 + k], this.pose[8 + k]]; },
  setAxis: function (k, v) { for (var i = 0; i < 3; i++) { this.pose[4 * i + k] = v[i]; } },
  target: function () {
    var at = this.axis(3), back = this.axis(2), d = this.distance;
    return at.map(function (v, i) { return v - d * back[i]; });
  },
  rotate: function (about, angle) {
    var c = Math.cos(angle), s = Math.sin(angle), a = about;
    for (var k = 0; k < 3; k++) {
      var v = this.axis(k), dot = a[0] * v[0] + a[1] * v[1] + a[2] * v[2];
      this.setAxis(k, [0, 1, 2].map(function (i) {
        var j = (i + 1) % 3, l = (i + 2) % 3;
        return v[i] * c + (a[j] * v[l] - a[l] * v[j]) * s + a[i] * dot * (1 - c);
      }));
    }
  },
  place: function (target) {
    var back = this.axis(2), d = this.distance;
    this.setAxis(3, target.map(function (v, i) { return v + d * back[i]; }));
    this.text = null;
  },
  // About what it looks at; not over the poles.
  orbit: function (across, down) {
    var target = this.target(), back = this.axis(2), up = this.up;
    var lift = Math.asin(Math.max(-1, Math.min(1, back[0] * up[0] + back[1] * up[1] + back[2] * up[2]))) + down;
    this.rotate(up, -across);
    if (Math.abs(lift) < 1.55) { this.rotate(this.axis(0), -down); }
    this.square();
    this.place(target);
  },
  pan: function (across, down) {
    var right = this.axis(0), up = this.axis(1), d = this.distance, f = this.f;
    this.place(this.target().map(function (v, i) { return v - d * (across / f[0] * right[i] - down / f[1] * up[i]); }));
  },
  zoom: function (factor) {
    var target = this.target();
    this.distance = Math.max(0.02, Math.min(1e4, this.distance * factor));
    this.place(target);
  },
  // Small errors of many turns go.
  square: function () {
    var r = this.axis(0), b = this.axis(2);
    function unit(v) { var n = Math.hypot(v[0], v[1], v[2]); return v.map(function (x) { return x / n; }); }
    b = unit(b);
    var dot = r[0] * b[0] + r[1] * b[1] + r[2] * b[2];
    r = unit(r.map(function (x, i) { return x - dot * b[i]; }));
    this.setAxis(0, r), this.setAxis(2, b);
    this.setAxis(1, [b[1] * r[2] - b[2] * r[1], b[2] * r[0] - b[0] * r[2], b[0] * r[1] - b[1] * r[0]]);
  },
  size: function (share) { return [Math.max(1, Math.floor(this.width * share)), Math.max(1, Math.floor(this.height * share))]; },
  // For a picture of this share of the pixels.
  print: function (share) {
    if (this.text && share === 1) { return this.text; }
    var list = this.size(share), s = share;
    list = list.concat(this.f.map(function (v) { return v * s; }), this.c.map(function (v) { return v * s; }), this.pose, this.lens);
    return list.map(function (v) { return Number.isInteger(v) ? v : +v.toPrecision(9); }).join(',');
  }
};
