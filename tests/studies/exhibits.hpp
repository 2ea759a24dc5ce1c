// Commands of ricochet-studies that repeat a table or a figure of a paper, and their properties.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app.hpp"

namespace ricochet {

/// Whether every tag that is opened is closed, in order; quotes, comments and declarations are
/// skipped.
inline bool is_well_formed(const std::string& xml)
{
    Words open;
    for (std::size_t at = xml.find('<'); at != std::string::npos; at = xml.find('<', at)) {
        if (xml.compare(at, 4, "<!--") == 0) {
            at = xml.find("-->", at);
            if (at == std::string::npos) return false;
            continue;
        }
        std::size_t end = at;
        for (char quote = 0; end < xml.size() && (quote != 0 || xml[end] != '>'); ++end) {
            if (quote != 0 && xml[end] == quote)
                quote = 0;
            else if (quote == 0 && (xml[end] == '"' || xml[end] == '\''))
                quote = xml[end];
        }
        if (end == xml.size()) return false;
        const std::string tag = xml.substr(at + 1, end - at - 1);
        at = end;
        if (tag.empty()) return false;
        if (tag[0] == '?' || tag[0] == '!' || tag.back() == '/') continue;
        const std::string name = tag.substr(0, tag.find_first_of(" \t\n"));
        if (name[0] != '/') {
            open.push_back(name);
        } else if (open.empty() || "/" + open.back() != name) {
            return false;
        } else {
            open.pop_back();
        }
    }
    return open.empty();
}

/// How often `piece` is in `text`.
inline std::size_t count_of(const std::string& text, const std::string& piece)
{
    std::size_t count = 0;
    for (std::size_t at = text.find(piece); at != std::string::npos;
         at = text.find(piece, at + 1)) {
        ++count;
    }
    return count;
}

/// Escaped as in XML.
inline std::string escaped(const std::string& text)
{
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&': out += "&amp;"; break;
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            default: out += c;
        }
    }
    return out;
}

class Exhibits : public App {
protected:
    /// Expects every number of ours to be as near the paper's as the command states.
    static void expect_agreement(const nlohmann::json& exhibit)
    {
        for (const auto& each : exhibit.at("agreements")) {
            EXPECT_TRUE(each["holds"]) << each.dump();
        }
    }

    void expect_table(const std::string& paper, int number) const
    {
        SCOPED_TRACE(paper + ", table " + std::to_string(number));
        const nlohmann::json table = json({"table", paper, std::to_string(number), "--json"});
        EXPECT_FALSE(table["rows"].empty());
        EXPECT_FALSE(table["agreements"].empty());
        for (const auto& row : table["rows"]) {
            EXPECT_EQ(row["values"].size(), table["columns"].size()) << row.dump();
        }
        expect_agreement(table);
    }

    /// Expects the picture to be well formed and to have a named shape for each curve, and a cell
    /// for each value of a grid.
    void expect_figure(const std::string& paper, int number) const
    {
        SCOPED_TRACE(paper + ", figure " + std::to_string(number));
        const nlohmann::json figure =
            json({"figure", paper, std::to_string(number), "--json", "--out", "figure.svg"});
        const std::string svg = content(work() / "figure.svg");
        ASSERT_TRUE(svg.find("<svg") != std::string::npos);
        EXPECT_TRUE(is_well_formed(svg));
        EXPECT_FALSE(figure["panels"].empty());
        std::size_t cells = 0;
        for (const auto& panel : figure["panels"]) {
            for (const char* label : {"title", "x", "y"}) {
                EXPECT_NE(svg.find(escaped(panel[label])), std::string::npos) << panel[label];
            }
            for (const auto& curve : panel["curves"]) {
                EXPECT_GE(curve["x"].size(), 2U) << curve["name"];
                EXPECT_EQ(curve["x"].size(), curve["y"].size()) << curve["name"];
                EXPECT_NE(svg.find(escaped(curve["name"])), std::string::npos) << curve["name"];
            }
            if (!panel.contains("tiles")) continue;
            for (const auto& value : panel["tiles"]["value"]) cells += !value.is_null();
        }
        EXPECT_GE(count_of(svg, "<rect") + count_of(svg, "<polygon"), cells);
        EXPECT_GE(count_of(svg, "<path") + count_of(svg, "<use"), 2U);
        expect_agreement(figure);
    }
};

}  // namespace ricochet
