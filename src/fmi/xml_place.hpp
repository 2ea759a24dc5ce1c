// Attributes of elements in a file of XML, and refusals that name the line.
#pragma once

#include <cstdint>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace ricochet::fmi {

class XmlFile {
public:
    /// @param name  for messages
    /// @throws Error if it cannot be read, or is no XML
    XmlFile(const std::string& path, std::string name);

    [[nodiscard]] pugi::xml_node root() const { return document_.document_element(); }

    /// "file:line: <element> what"
    [[noreturn]] void fail(const pugi::xml_node& node, std::string_view what) const;

    [[nodiscard]] static std::optional<std::string> text(const pugi::xml_node& node,
                                                         const char* attribute);
    /// @throws Error unless the attribute is there and not empty
    [[nodiscard]] std::string needed(const pugi::xml_node& node, const char* attribute) const;
    /// "true", "1", "false" or "0"; absent: false.
    [[nodiscard]] bool flag(const pugi::xml_node& node, const char* attribute) const;
    [[nodiscard]] std::optional<double> number(const pugi::xml_node& node,
                                               const char* attribute) const;
    /// Numbers with spaces between them; booleans as 0 and 1.
    [[nodiscard]] std::vector<double> numbers(const pugi::xml_node& node,
                                              const char* attribute) const;
    /// A whole number from 0 to `most`.
    [[nodiscard]] std::optional<std::uint64_t> count(const pugi::xml_node& node,
                                                     const char* attribute,
                                                     std::uint64_t most) const;
    [[nodiscard]] std::uint64_t needed_count(const pugi::xml_node& node, const char* attribute,
                                             std::uint64_t most) const;
    /// Index of the attribute's text in `words`; absent: `otherwise`.
    [[nodiscard]] std::size_t choice(const pugi::xml_node& node, const char* attribute,
                                     const std::vector<std::string_view>& words,
                                     std::size_t otherwise) const;

private:
    [[nodiscard]] std::size_t line(std::ptrdiff_t offset) const;

    std::string name_, bytes_;
    pugi::xml_document document_;
};

}  // namespace ricochet::fmi
