// Looks at the finished page as a reader would and tells the parent what is wrong, one line each. PRINT: 1 applies the print style.
(function () {
  var wrong = [];
  function bad(text) { if (wrong.length < 40) { wrong.push(text); } }
  window.addEventListener('error', function (e) { bad('script error: ' + e.message + ' line ' + e.lineno); });
  var report = console.error;
  console.error = function () { bad('console.error: ' + Array.prototype.join.call(arguments, ' ')); report.apply(console, arguments); };

  function print_style() {
    Array.prototype.forEach.call(document.styleSheets, function (sheet) {
      Array.prototype.forEach.call(sheet.cssRules, function (rule) {
        if (!(rule instanceof CSSMediaRule)) { return; }
        if (/^print/.test(rule.media.mediaText)) { rule.media.mediaText = rule.media.mediaText.replace(/^print( and )?/, '') || 'all'; }
        else if (/prefers-color-scheme/.test(rule.media.mediaText)) { rule.media.mediaText = 'not all'; }
      });
    });
  }

  function visible(element, name) {
    var box = element.getBoundingClientRect(), style = getComputedStyle(element);
    if (box.width < 20 || box.height < 8) { bad(name + ' is ' + box.width + ' x ' + box.height); }
    if (style.visibility === 'hidden' || style.display === 'none' || +style.opacity === 0) { bad(name + ' is hidden'); }
    if (box.left < -1 || box.right > innerWidth + 1) { bad(name + ' leaves the window: ' + box.left + ' to ' + box.right); }
  }

  function luminance(colour) {
    var c = colour.match(/[\d.]+/g).slice(0, 3).map(function (v) {
      v /= 255;
      return v <= 0.04045 ? v / 12.92 : Math.pow((v + 0.055) / 1.055, 2.4);
    });
    return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
  }
  function contrast(a, b) {
    var x = luminance(a), y = luminance(b);
    return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
  }

  // A label on a bar has the bar as its background; it comes right behind it.
  function background(text, page) {
    var before = text.previousElementSibling;
    return /\b(in|part|dark)\b/.test(text.getAttribute('class')) && before ? getComputedStyle(before).fill : page;
  }

  function texts(svg, page) {
    var outer = svg.getBoundingClientRect(), list = Array.prototype.slice.call(svg.querySelectorAll('text'));
    var boxes = list.map(function (t) { return t.getBoundingClientRect(); });
    list.forEach(function (t, i) {
      var b = boxes[i], name = svg.id + ': "' + t.textContent + '"', ink = getComputedStyle(t).fill;
      if (b.width === 0) { return bad(name + ' is not drawn'); }
      if (b.left < outer.left - 3 || b.right > outer.right + 3 || b.top < outer.top - 3 || b.bottom > outer.bottom + 3) {
        bad(name + ' leaves its picture');
      }
      var ratio = contrast(ink, background(t, page));
      if (ratio < 4.4) { bad(name + ' has a contrast of ' + ratio.toFixed(2)); }
      for (var j = 0; j < i; j++) {
        var c = boxes[j], w = Math.min(b.right, c.right) - Math.max(b.left, c.left), h = Math.min(b.bottom, c.bottom) - Math.max(b.top, c.top);
        if (w > 1 && h > 4) { bad(name + ' covers "' + list[j].textContent + '"'); }
      }
    });
  }

  // What a table is about is seen whatever part of it is scrolled into view: its title does not move, nor do its rows' names.
  function table(scroll) {
    var left = scroll.getBoundingClientRect().left, t = scroll.querySelector('table'), name = scroll.querySelector('tbody th');
    var title = t.getAttribute('aria-labelledby');
    if (scroll.querySelector('caption,p')) { bad(t.id + ': its title scrolls away'); }
    if (title && !document.getElementById(title)) { bad(t.id + ' has no title ' + title); }
    if (title) { visible(document.getElementById(title), title); }
    scroll.scrollLeft = scroll.scrollWidth;
    if (name && name.getBoundingClientRect().left < left - 1) { bad(t.id + ': "' + name.textContent + '" scrolls away'); }
    scroll.scrollLeft = 0;
  }

  function check() {
    if (PRINT) { print_style(); }
    var page = getComputedStyle(document.body).backgroundColor;
    var dark = luminance(page) < 0.2, wants = !PRINT && matchMedia('(prefers-color-scheme: dark)').matches;
    if (dark !== wants) { bad('the page is ' + (dark ? 'dark' : 'light')); }
    if (document.documentElement.scrollWidth > innerWidth) { bad('the page is ' + document.documentElement.scrollWidth + ' wide'); }
    var figures = document.querySelectorAll('figure');
    Array.prototype.forEach.call(figures, function (f) {
      visible(f, f.id);
      if (!f.querySelector('svg,img')) { bad(f.id + ' has no picture'); }
    });
    Array.prototype.forEach.call(document.querySelectorAll('svg'), function (s) {
      visible(s, s.id || 'svg');
      texts(s, page);
    });
    Array.prototype.forEach.call(document.querySelectorAll('.scroll'), table);
    Array.prototype.forEach.call(document.querySelectorAll('img'), function (i) {
      visible(i, i.alt);
      if (!i.complete || i.naturalWidth === 0) { bad('a picture is broken: ' + i.alt); }
    });
    Array.prototype.forEach.call(document.querySelectorAll('p,li,td,th,figcaption,h1,h2,h3,dd,dt,a'), function (e) {
      var ratio = contrast(getComputedStyle(e).color, page);
      if (ratio < 4.4) { bad('"' + e.textContent.slice(0, 40) + '" has a contrast of ' + ratio.toFixed(2)); }
    });
    parent.postMessage((wrong.length ? wrong.join('\n') : 'ok') + '\n' + figures.length + ' figures, ' + innerWidth + ' wide, ' +
      (dark ? 'dark' : 'light'), '*');
  }
  window.addEventListener('load', function () { setTimeout(check, 50); });
})();
