'use strict';
// What both pages share: questions to the program that served them, and small tools of the document.
var View = {};
(function () {
  var token = new URLSearchParams(location.search).get('token') || '';
  View.$ = function (id) { return document.getElementById(id); };
  View.url = function (path, asked) {
    var q = new URLSearchParams(asked || {});
    q.set('token', token);
    return path + '?' + q;
  };
  View.problem = function (text) {
    var box = View.$('problem');
    box.textContent = text || '';
    box.hidden = !text;
  };
  // A reply, or an Error with the program's one line.
  View.ask = function (path, asked, signal) {
    return fetch(View.url(path, asked), { signal: signal, cache: 'no-store' }).then(function (r) {
      if (r.ok) { return r; }
      return r.json().then(function (j) { throw new Error(j.error); }, function () { throw new Error('HTTP ' + r.status); });
    }, function (e) {
      throw e.name === 'AbortError' ? e : new Error('The program that served this page has ended.');
    });
  };
  View.json = function (path, asked, signal) { return View.ask(path, asked, signal).then(function (r) { return r.json(); }); };
  View.told = function (e) { if (e.name !== 'AbortError') { View.problem(e.message); } };
  View.count = function (n) { return Math.round(n).toLocaleString('en').replace(/,/g, '\u202f'); };
  View.energy = function (fj) {
    var unit = ['fJ', 'pJ', 'nJ', '\u00b5J', 'mJ', 'J'], i = 0;
    for (; i < 5 && fj >= 999.95; i++) { fj /= 1000; }
    return fj.toPrecision(4) + ' ' + unit[i];
  };
  View.put = function (id, text) { View.$(id).textContent = text; };
})();
