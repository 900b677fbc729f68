//! The parts that pages are made of.
//!
//! A page has one heading, a link past its table of contents, landmarks and a section a question. Wide pictures and tables scroll
//! inside their own frames, which the keyboard reaches too; what is secondary is folded, and unfolded in print. There are no
//! scripts, and nothing is loaded from elsewhere.

pub(super) use super::chart::escaped;

/// Colours have a contrast of at least 4.5 to 1.
const STYLE: &str = "\
:root{color-scheme:light}*{box-sizing:border-box}\
body{font:16px/1.5 system-ui,sans-serif;max-width:56rem;margin:0 auto;padding:1rem;color:#222;background:#fff;\
overflow-wrap:break-word}\
h1{font-size:1.5rem;line-height:1.25;margin:.5rem 0}h2{font-size:1.25rem;line-height:1.3;margin:2.4rem 0 .6rem;\
border-top:1px solid #ccc;padding-top:1rem}h3{font-size:1rem;margin:1.4rem 0 .3rem}\
p,li{max-width:44rem}.verdict{font-size:1.25rem;line-height:1.35;font-weight:600;overflow-wrap:anywhere;margin:.6rem 0;\
border-left:4px solid #0072b2;padding-left:.7rem}\
.first figure{margin:0}@media (min-width:50rem){.first{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1.5fr);gap:1.2rem;\
min-height:56vh;align-content:start}}\
a{color:#00538a}a:focus-visible,summary:focus-visible,.wide:focus-visible,main:focus-visible{outline:3px solid #b34700;\
outline-offset:2px}main:focus{outline:none}\
.skip{position:absolute;left:.5rem;top:-4rem;background:#fff;padding:.4rem .8rem;border:1px solid #222}.skip:focus{top:.5rem}\
nav ul{list-style:none;padding:0;margin:.8rem 0;display:flex;flex-wrap:wrap;gap:.1rem 1.2rem}\
nav a{display:inline-block;padding:.25rem 0}\
figure{margin:1rem 0;break-inside:avoid}figcaption,caption{font-size:.875rem;color:#444;text-align:left}\
figcaption{max-width:44rem}.wide{overflow-x:auto;max-width:100%}.wide svg{display:block;min-width:22.5rem;max-width:42rem!important}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;margin:.3rem 0}caption{padding:.2rem 0}\
td,th{padding:.25rem .8rem .25rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #ddd}\
td.n,th.n{text-align:right}td.n,thead th,th[scope=row]{white-space:nowrap}td:not(.n){min-width:5rem}\
caption span{display:block;position:sticky;left:0;max-width:min(44rem,100vw - 2rem)}details{margin:.6rem 0}summary{cursor:pointer;color:#00538a;padding:.25rem 0}\
pre{background:#f4f4f4;padding:.6rem;white-space:pre-wrap;overflow-wrap:anywhere;font-size:.875rem}\
code{font-size:.875rem;overflow-wrap:anywhere}\
.matrix td{min-width:0!important}.matrix td,.matrix th{padding:.2rem .4rem;text-align:center;font-size:.8125rem;vertical-align:bottom;border:1px solid #ddd}\
.matrix tbody th{text-align:left;white-space:nowrap}.matrix thead th.turned{writing-mode:vertical-rl;transform:rotate(180deg);\
text-align:left}.matrix td.right{border:2px solid #222;font-weight:700}\
@media (max-width:40rem){body{padding:.75rem}table{font-size:.875rem}th[scope=row]{white-space:normal;min-width:7rem}figure>.wide{margin:0 -.75rem;max-width:none}}\
@media print{body{margin:0;max-width:none;padding:0;font-size:11pt}nav,.skip{display:none}h2,h3,summary{break-after:avoid}\
tr,pre,.matrix{break-inside:avoid}p:has(+figure){break-after:avoid}.wide{overflow:visible}.wide svg{min-width:0;max-width:34rem!important}\
td,th{padding-right:.35rem}table{font-size:8pt}td:not(.n){min-width:0}thead th{white-space:normal}\
details::details-content{content-visibility:visible;display:block;height:auto}summary{color:#222;list-style:none}}";

/// A page: its heading, what stands above all sections, then the sections behind a table of contents.
pub(super) fn page(title: &str, lead: &str, sections: &[Section]) -> String {
    let title = escaped(title);
    let contents: String = (sections.iter())
        .map(|s| {
            let heading = escaped(s.heading);
            format!("<li><a href=\"#{}\">{heading}</a></li>\n", s.id)
        })
        .collect();
    let body: String = sections.iter().map(Section::html).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<a class=\"skip\" href=\"#content\">Skip to the content</a>\n\
         <header>\n<h1>{title}</h1>\n{lead}</header>\n\
         <nav aria-label=\"On this page\">\n<ul>\n{contents}</ul>\n</nav>\n\
         <main id=\"content\" tabindex=\"-1\">\n{body}</main>\n</body>\n</html>\n"
    )
}

/// A section of a page, named by its heading.
pub(super) struct Section {
    id: &'static str,
    heading: &'static str,
    body: String,
}

impl Section {
    /// A section with its address inside the page and what stands below its heading.
    pub(super) fn new(id: &'static str, heading: &'static str, body: String) -> Self {
        Self { id, heading, body }
    }

    fn html(&self) -> String {
        let Self { id, heading, body } = self;
        let heading = escaped(heading);
        format!(
            "<section id=\"{id}\" aria-labelledby=\"{id}-heading\">\n<h2 id=\"{id}-heading\">{heading}</h2>\n{body}</section>\n"
        )
    }
}

/// A heading inside a section.
pub(super) fn subheading(text: &str) -> String {
    format!("<h3>{}</h3>\n", escaped(text))
}

/// A paragraph of plain text.
pub(super) fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escaped(text))
}

/// Items of plain text.
pub(super) fn list(items: &[String]) -> String {
    let items: String = (items.iter())
        .map(|item| format!("<li>{}</li>\n", escaped(item)))
        .collect();
    format!("<ul>\n{items}</ul>\n")
}

/// Text for copying, line by line.
pub(super) fn preformatted(text: &str) -> String {
    let lines: Vec<String> = text.lines().map(escaped).collect();
    format!("<pre>{}</pre>\n", lines.join("\n"))
}

/// A secondary part: folded on the screen, unfolded in print.
pub(super) fn folded(summary: &str, body: &str) -> String {
    format!(
        "<details>\n<summary>{}</summary>\n{body}</details>\n",
        escaped(summary)
    )
}

/// A frame that scrolls sideways where its content is wider than the screen.
fn scrolling(name: &str, body: &str) -> String {
    format!(
        "<div class=\"wide\" role=\"group\" tabindex=\"0\" aria-label=\"{}\">\n{body}</div>\n",
        escaped(name)
    )
}

/// A picture; the caption is plain text.
pub(super) fn figure(svg: &str, caption: &str) -> String {
    let frame = scrolling("Picture, may scroll sideways", svg);
    format!(
        "<figure>\n{frame}<figcaption>{}</figcaption>\n</figure>\n",
        escaped(caption)
    )
}

/// Kind of a column.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    Text,
    Number,
}

/// A table of plain text. The first cell of a row names it.
pub(super) fn table(caption: &str, head: &[(&str, Column)], rows: &[Vec<String>]) -> String {
    let class = |column: Column| match column {
        Column::Text => "",
        Column::Number => " class=\"n\"",
    };
    let heads: String = (head.iter())
        .map(|(name, column)| format!("<th scope=\"col\"{}>{}</th>", class(*column), escaped(name)))
        .collect();
    let lines: String = (rows.iter())
        .map(|row| {
            let cells: String = (row.iter().zip(head).enumerate())
                .map(|(j, (cell, (_, column)))| {
                    let (cell, class) = (escaped(cell), class(*column));
                    match j {
                        0 => format!("<th scope=\"row\"{class}>{cell}</th>"),
                        _ => format!("<td{class}>{cell}</td>"),
                    }
                })
                .collect();
            format!("<tr>{cells}</tr>\n")
        })
        .collect();
    scrolling(
        "Table, may scroll sideways",
        &format!(
            "<table>\n<caption><span>{}</span></caption>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n",
            escaped(caption)
        ),
    )
}

/// A page with lines of small print at its end.
pub(crate) fn with_footer(page: &str, lines: &[String]) -> String {
    let lines: Vec<String> = lines.iter().map(|line| escaped(line)).collect();
    let footer = format!("<footer><p>{}</p></footer>\n</body>", lines.join("<br>\n"));
    match page.rsplit_once("</body>") {
        Some((before, after)) => format!("{before}{footer}{after}"),
        None => page.to_owned(),
    }
}

/// A cell of a matrix.
pub(super) struct Shade {
    /// Text.
    pub(super) text: String,
    /// Darkness, 0 to 1.
    pub(super) weight: f64,
    /// Framed and bold.
    pub(super) right: bool,
}

/// A matrix of shaded cells; `None` is empty.
pub(super) fn matrix(
    caption: &str,
    head: &[String],
    rows: &[(String, Vec<Option<Shade>>)],
) -> String {
    let heads: String = (head.iter())
        .map(|name| format!("<th scope=\"col\" class=\"turned\">{}</th>", escaped(name)))
        .collect();
    let cell = |shade: &Option<Shade>| match shade {
        None => "<td></td>".to_owned(),
        Some(Shade {
            text,
            weight,
            right,
        }) => {
            let (class, colour) = match right {
                true => (" class=\"right\"", "0 114 178"),
                false => ("", "213 94 0"),
            };
            // At most half: text on it stays legible.
            let opacity = 0.1 + 0.4 * weight.clamp(0.0, 1.0);
            format!(
                "<td{class} style=\"background:rgb({colour} / {opacity:.2})\">{}</td>",
                escaped(text)
            )
        }
    };
    let lines: String = (rows.iter())
        .map(|(name, cells)| {
            let cells: String = cells.iter().map(cell).collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", escaped(name))
        })
        .collect();
    scrolling(
        "Table, may scroll sideways",
        &format!(
            "<table class=\"matrix\">\n<caption><span>{}</span></caption>\n<thead><tr><td></td>{heads}</tr></thead>\n<tbody>\n{lines}</tbody>\n\
             </table>\n",
            escaped(caption)
        ),
    )
}
