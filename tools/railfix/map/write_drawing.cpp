#include <algorithm>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "core/whole_file.hpp"
#include "escape_html.hpp"
#include "map/drawing.hpp"
#include "picture_file.hpp"

namespace railfix::tool {
namespace {

std::string hex(const Drawing::Colour& colour) {
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", colour.red & 255, colour.green & 255, colour.blue & 255);
  return text;
}

// XML knows no control characters.
std::string escaped(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return escape_html(text);
}

void write_svg(const Drawing& drawing, std::ostream& out) {
  char text[160];
  std::snprintf(text, sizeof text, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\">\n",
                drawing.width, drawing.height);
  out << text << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (const Drawing::Line& line : drawing.lines) {
    out << "<polyline fill=\"none\" stroke=\"" << hex(line.colour) << "\" stroke-width=\"" << line.width
        << "\" points=\"";
    for (const Eigen::Vector2d& point : line.points) {
      std::snprintf(text, sizeof text, "%.2f,%.2f ", point.x(), point.y());
      out << text;
    }
    out << "\"/>\n";
  }
  for (const Drawing::Dot& dot : drawing.dots) {
    std::snprintf(text, sizeof text, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"%.1f\" fill=\"%s\" stroke=\"%s\"/>\n",
                  dot.at.x(), dot.at.y(), dot.radius, dot.filled ? hex(dot.colour).c_str() : "white",
                  hex(dot.colour).c_str());
    out << text;
  }
  for (const Drawing::Label& label : drawing.labels) {
    std::snprintf(text, sizeof text, "<text x=\"%.1f\" y=\"%.1f\" font-family=\"sans-serif\" font-size=\"%.0f\">",
                  label.at.x(), label.at.y(), label.size);
    out << text << escaped(label.text) << "</text>\n";
  }
  out << "</svg>\n";
}

/// OpenCV's font has no more than ASCII: letters with marks lose them, what has no such letter becomes '?'.
std::string ascii(const std::string& text) {
  // U+00C0 to U+00FF, two characters each.
  static constexpr std::string_view kLatin1 =
      "A A A A AeA AEC E E E E I I I I D N O O O O Oex OeU U U UeY Thss"
      "a a a a aea aec e e e e i i i i d n o o o o oe/ oeu u u uey thy ";
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte < 0x7f) {
      out += text[i];
      continue;
    }
    if (byte == 0xc3 && i + 1 < text.size()) {
      const size_t letter = 2 * (static_cast<unsigned char>(text[i + 1]) & 0x3fU);
      for (const char c : kLatin1.substr(letter, 2)) {
        if (c != ' ') out += c;
      }
    } else {
      out += '?';
    }
    while (i + 1 < text.size() && (static_cast<unsigned char>(text[i + 1]) & 0xc0U) == 0x80U) ++i;
  }
  return out;
}

cv::Mat picture_of(const Drawing& drawing) {
  constexpr int kShift = 4;  // sixteenths of a pixel
  cv::Mat out(static_cast<int>(drawing.height), static_cast<int>(drawing.width), CV_8UC3, cv::Scalar::all(255));
  const auto fixed = [](const Eigen::Vector2d& at) {
    return cv::Point(cvRound(at.x() * (1 << kShift)), cvRound(at.y() * (1 << kShift)));
  };
  const auto scalar = [](const Drawing::Colour& c) { return cv::Scalar(c.blue, c.green, c.red); };
  for (const Drawing::Line& line : drawing.lines) {
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& point : line.points) {
      // Far outside the picture the fixed-point numbers would run over.
      if (point.cwiseAbs().maxCoeff() < 1e6) points.push_back(fixed(point));
    }
    cv::polylines(out, points, false, scalar(line.colour), std::max(1, cvRound(line.width)), cv::LINE_AA, kShift);
  }
  for (const Drawing::Dot& dot : drawing.dots) {
    cv::circle(out, fixed(dot.at), cvRound(dot.radius * (1 << kShift)), scalar(dot.colour), dot.filled ? cv::FILLED : 1,
               cv::LINE_AA, kShift);
  }
  for (const Drawing::Label& label : drawing.labels) {
    cv::putText(out, ascii(label.text), cv::Point(cvRound(label.at.x()), cvRound(label.at.y())),
                cv::FONT_HERSHEY_SIMPLEX, label.size / 28.0, cv::Scalar(0, 0, 0), 1, cv::LINE_AA);
  }
  return out;
}

}  // namespace

core::Status write_drawing(const Drawing& drawing, const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".png") return write_picture(file, picture_of(drawing));
  if (ending != ".svg") return core::Error{file.string() + " must end in .svg or .png"};
  std::ostringstream text;
  write_svg(drawing, text);
  return core::write_whole(file, text.str());
}

}  // namespace railfix::tool
