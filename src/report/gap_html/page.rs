//! The parts that pages are made of.

pub(super) use crate::report::chart::escaped;

/// Wide tables scroll on a phone; nothing that belongs together is torn apart in print.
const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:56rem;margin:2rem auto;padding:0 1rem;color:#222;\
background:#fff}h1{font-size:1.5rem;line-height:1.25}h2{font-size:1.2rem;margin-top:2.2rem}.verdict{font-size:1.25rem;\
font-weight:600;overflow-wrap:anywhere}figure{margin:1rem 0;break-inside:avoid}figcaption,caption{font-size:.875rem;color:#444;\
text-align:left}.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}caption{padding:.2rem 0}\
td,th{padding:.25rem .8rem .25rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #ddd}\
td.n,th.n{text-align:right}pre{background:#f4f4f4;padding:.6rem;overflow-x:auto}\
@media print{body{margin:0;max-width:none}h2{break-after:avoid}tr{break-inside:avoid}}";

/// A page with its heading.
pub(super) fn page(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n{body}</main>\n</body>\n</html>\n"
    )
}

/// A section with its heading, named by it.
pub(super) fn section(id: &str, heading: &str, body: &str) -> String {
    format!(
        "<section id=\"{id}\" aria-labelledby=\"{id}-heading\">\n<h2 id=\"{id}-heading\">{heading}</h2>\n{body}</section>\n"
    )
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

/// A picture; the caption is plain text.
pub(super) fn figure(svg: &str, caption: &str) -> String {
    format!(
        "<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>\n",
        escaped(caption)
    )
}

/// What stands in a column.
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
    format!(
        "<div class=\"wide\">\n<table>\n<caption>{}</caption>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n\
         </div>\n",
        escaped(caption)
    )
}
