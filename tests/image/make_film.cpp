// make_film FILE WIDTH HEIGHT FRAMES RATE [numbered]: a film with what is hard to follow: things that move, a fade, and
// cuts. Numbered, a strip at the left, a sixteenth of the width, says three times from top to bottom which frame it is:
// a white block, a black one, then the ten bits of its number, the highest first.
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

constexpr int copies = 3, bits = 10, blocks = copies * (bits + 2);

void write_number(int frame, cv::Mat &picture) {
  for (int block = 0; block < blocks; block++) {
    int place = block % (bits + 2);
    bool white = place == 0 || (place > 1 && (frame >> (bits + 1 - place) & 1) != 0);
    int top = picture.rows * block / blocks, bottom = picture.rows * (block + 1) / blocks;
    picture(cv::Rect(0, top, picture.cols / 16, bottom - top))
        .setTo(white ? cv::Scalar::all(230) : cv::Scalar::all(20));
  }
}

} // namespace

int main(int count, char **arguments) {
  if (count < 6) {
    std::fputs("make_film FILE WIDTH HEIGHT FRAMES RATE [numbered]\n", stderr);
    return 2;
  }
  int width = std::atoi(arguments[2]), height = std::atoi(arguments[3]), frames = std::atoi(arguments[4]);
  cv::VideoWriter writer(arguments[1], cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), std::atof(arguments[5]),
                         cv::Size(width, height));
  for (int frame = 0; frame < frames && writer.isOpened(); frame++) {
    cv::Mat picture = draw(width, height, frame);
    if (count > 6) {
      write_number(frame, picture);
    }
    writer.write(picture);
  }
  return writer.isOpened() ? 0 : 1;
}
