// make_film FILE WIDTH HEIGHT FRAMES RATE: a film with what is hard to follow: things that move, a fade, and cuts.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

namespace {

// Every 40 frames another scene, over a grey that fades; a bright disc and a bar go across it.
cv::Mat draw(int width, int height, int frame) {
  int scene = frame / 40, at = frame % 40;
  double fade = 0.5 - 0.5 * std::cos(2 * CV_PI * at / 40);
  const cv::Scalar grounds[] = {{90, 110, 60}, {30, 60, 150}, {140, 90, 40}, {70, 70, 70}};
  cv::Mat picture(height, width, CV_8UC3, grounds[scene % 4] * (0.4 + 0.6 * fade));
  cv::Point centre(width * (at + 5) / 50, static_cast<int>(height * (0.5 + 0.25 * std::sin(0.15 * frame))));
  cv::circle(picture, centre, height / 6, cv::Scalar(210, 220, 235), cv::FILLED, cv::LINE_AA);
  int x = width - width * at / 40;
  cv::rectangle(picture, cv::Rect(x, height / 8, width / 10, height / 5), cv::Scalar(40, 160, 220), cv::FILLED);
  return picture;
}

} // namespace

int main(int count, char **arguments) {
  if (count != 6) {
    std::fputs("make_film FILE WIDTH HEIGHT FRAMES RATE\n", stderr);
    return 2;
  }
  int width = std::atoi(arguments[2]), height = std::atoi(arguments[3]), frames = std::atoi(arguments[4]);
  cv::VideoWriter writer(arguments[1], cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), std::atof(arguments[5]),
                         cv::Size(width, height));
  for (int frame = 0; frame < frames && writer.isOpened(); frame++) {
    writer.write(draw(width, height, frame));
  }
  return writer.isOpened() ? 0 : 1;
}
