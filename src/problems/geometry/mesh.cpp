#include "mesh.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

namespace ricochet::geometry {

namespace {

using Face = std::array<std::uint32_t, 3>;
using Edge = std::pair<std::uint32_t, std::uint32_t>;

[[noreturn]] void refuse(std::size_t line, std::string_view what)
{
    throw std::invalid_argument(fmt::format("read_mesh: line {}: {}", line, what));
}

/// The lines of a text, without comments; counted from 1.
class Lines {
public:
    explicit Lines(std::string_view text) : text_(std::string(text)) {}

    /// Reads the next line that is not empty; false at the end.
    bool next(std::istringstream& out)
    {
        std::string line;
        while (std::getline(text_, line)) {
            ++number_;
            line = line.substr(0, line.find('#'));
            if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
            out.clear();
            out.str(line);
            return true;
        }
        return false;
    }
    [[nodiscard]] std::size_t number() const noexcept { return number_; }

private:
    std::istringstream text_;
    std::size_t number_ = 0;
};

Eigen::Vector3d vertex(std::istringstream& line, std::size_t number)
{
    Eigen::Vector3d out;
    for (int k = 0; k < 3; ++k) {
        std::string word;  // streams do not read "nan"
        if (!(line >> word)) refuse(number, "a vertex needs three coordinates");
        try {
            std::size_t used = 0;
            out(k) = std::stod(word, &used);
            if (used == word.size()) continue;
        } catch (const std::exception&) {
        }
        refuse(number, fmt::format("'{}' is not a number", word));
    }
    return out;
}

void add_face(Mesh& mesh, const std::vector<long>& corners, std::size_t line)
{
    if (corners.size() < 3) refuse(line, "a face needs three vertices");
    const auto index = [&](long corner) {
        if (corner < 0 || corner >= static_cast<long>(mesh.vertices.size())) {
            refuse(line,
                   fmt::format("face {} has a vertex that does not exist", mesh.faces.size()));
        }
        return static_cast<std::uint32_t>(corner);
    };
    for (std::size_t k = 1; k + 1 < corners.size(); ++k) {
        mesh.faces.push_back({index(corners[0]), index(corners[k]), index(corners[k + 1])});
    }
}

Mesh read_off(Lines& lines)
{
    Mesh mesh;
    std::istringstream line;
    std::size_t vertices = 0, faces = 0;
    if (!lines.next(line) || !(line >> vertices >> faces)) {
        refuse(lines.number(), "expected the numbers of vertices and faces");
    }
    for (std::size_t i = 0; i < vertices; ++i) {
        if (!lines.next(line)) refuse(lines.number(), "the text ends among the vertices");
        mesh.vertices.push_back(vertex(line, lines.number()));
    }
    for (std::size_t i = 0; i < faces; ++i) {
        std::size_t count = 0;
        if (!lines.next(line)) refuse(lines.number(), "the text ends among the faces");
        if (!(line >> count) || count > 1000) refuse(lines.number(), "expected a face");
        std::vector<long> corners(count);
        for (long& corner : corners) {
            if (!(line >> corner)) refuse(lines.number(), "a face needs all its vertices");
        }
        add_face(mesh, corners, lines.number());
    }
    return mesh;
}

/// The vertex of "7", "7/1" or "-1//2", from 0.
long corner(const std::string& word, std::size_t vertices, std::size_t line)
{
    try {
        const long number = std::stol(word);
        return number > 0 ? number - 1 : number < 0 ? number + static_cast<long>(vertices) : -1;
    } catch (const std::exception&) {
        refuse(line, fmt::format("'{}' is not a vertex", word));
    }
}

std::string edge_name(Edge edge)
{
    return fmt::format("from vertex {} to {}", edge.first, edge.second);
}

}  // namespace

Mesh read_mesh(std::string_view text)
{
    Lines lines(text);
    Mesh mesh;
    std::istringstream line;
    std::string word;
    for (bool first = true; lines.next(line); first = false) {
        line >> word;
        if (first && word == "OFF") return read_off(lines);
        if (word == "v") mesh.vertices.push_back(vertex(line, lines.number()));
        if (word != "f") continue;
        std::vector<long> corners;
        while (line >> word) corners.push_back(corner(word, mesh.vertices.size(), lines.number()));
        add_face(mesh, corners, lines.number());
    }
    return mesh;
}

void require_closed(const Mesh& mesh)
{
    if (mesh.faces.empty()) throw std::invalid_argument("mesh: there is no face");
    std::map<Edge, std::size_t> edges;
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
        const Face& face = mesh.faces[i];
        for (const std::uint32_t v : face) {
            if (v >= mesh.vertices.size()) {
                throw std::invalid_argument(
                    fmt::format("mesh: face {} has vertex {}, which does not exist", i, v));
            }
            if (!mesh.vertices[v].allFinite()) {
                throw std::invalid_argument(
                    fmt::format("mesh: face {} has vertex {}, which is not finite", i, v));
            }
        }
        const Eigen::Vector3d& a = mesh.vertices[face[0]];
        const double area =
            (mesh.vertices[face[1]] - a).cross(mesh.vertices[face[2]] - a).norm() / 2;
        if (!(area > 0) || !std::isfinite(area)) {
            throw std::invalid_argument(
                fmt::format("mesh: the area of face {} must be positive, got {}", i, area));
        }
        for (std::size_t k = 0; k < 3; ++k) {
            const Edge edge{face[k], face[(k + 1) % 3]};
            const auto [found, fresh] = edges.emplace(edge, i);
            if (!fresh) {
                throw std::invalid_argument(
                    fmt::format("mesh: faces {} and {} run through the edge {} the same way",
                                found->second, i, edge_name(edge)));
            }
        }
    }
    for (const auto& [edge, face] : edges) {
        if (!edges.contains({edge.second, edge.first})) {
            throw std::invalid_argument(
                fmt::format("mesh: it is open; face {} has no neighbour at its edge {}", face,
                            edge_name(edge)));
        }
    }
}

int winding_number(const Mesh& mesh, const Eigen::Vector3d& p)
{
    double angle = 0;
    for (const auto& [i, j, k] : mesh.faces) {
        const Eigen::Vector3d a = mesh.vertices[i] - p;
        const Eigen::Vector3d b = mesh.vertices[j] - p;
        const Eigen::Vector3d c = mesh.vertices[k] - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        angle += 2 * std::atan2(a.dot(b.cross(c)),
                                la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return static_cast<int>(std::lround(angle / (4 * std::numbers::pi)));
}

Mesh bumpy_sphere(int refinements, const std::function<double(const Eigen::Vector3d&)>& radius)
{
    const double g = std::numbers::phi;
    Mesh mesh;
    for (const double s : {-1.0, 1.0}) {
        for (const double u : {-g, g}) {
            mesh.vertices.emplace_back(0, s, u);
            mesh.vertices.emplace_back(s, u, 0);
            mesh.vertices.emplace_back(u, 0, s);
        }
    }
    // The faces are the triples at the distance of an edge, 2, seen counterclockwise from outside.
    const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
    const auto near = [&](std::uint32_t i, std::uint32_t j) {
        return (mesh.vertices[i] - mesh.vertices[j]).norm() < 2.1;
    };
    for (std::uint32_t i = 0; i < n; ++i) {
        for (std::uint32_t j = i + 1; j < n; ++j) {
            for (std::uint32_t k = j + 1; k < n; ++k) {
                if (!near(i, j) || !near(j, k) || !near(i, k)) continue;
                const double turn = mesh.vertices[i].dot(mesh.vertices[j].cross(mesh.vertices[k]));
                mesh.faces.push_back(turn > 0 ? Face{i, j, k} : Face{i, k, j});
            }
        }
    }
    for (int r = 0; r < refinements; ++r) {
        std::map<Edge, std::uint32_t> middles;
        const auto middle = [&](std::uint32_t i, std::uint32_t j) {
            const Edge edge = std::minmax(i, j);
            const auto [found, fresh] =
                middles.emplace(edge, static_cast<std::uint32_t>(mesh.vertices.size()));
            if (fresh) {
                mesh.vertices.push_back((mesh.vertices[i] + mesh.vertices[j]).normalized());
            }
            return found->second;
        };
        std::vector<Face> finer;
        for (const auto& [a, b, c] : mesh.faces) {
            const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
        }
        mesh.faces = std::move(finer);
    }
    for (Eigen::Vector3d& v : mesh.vertices) {
        v.normalize();
        v *= radius(v);
    }
    return mesh;
}

}  // namespace ricochet::geometry
