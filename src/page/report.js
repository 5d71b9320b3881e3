(function(){
var bars=Array.prototype.slice.call(document.querySelectorAll('svg .bar'));
function layer(e){var m=/ l[0-4]( |$)/.exec(e.getAttribute('class'));return m?m[0].trim():null}
function show(name){
if(name){document.body.setAttribute('data-layer',name)}else{document.body.removeAttribute('data-layer')}
bars.forEach(function(b){b.classList.toggle('lit',!name||layer(b)===name||!layer(b))})}
bars.forEach(function(b){var name=layer(b);if(!name){return}
b.addEventListener('pointerenter',function(){show(name)});
b.addEventListener('pointerleave',function(){show(null)})});
})();
