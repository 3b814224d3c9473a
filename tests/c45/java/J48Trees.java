import java.io.BufferedReader;
import java.io.FileReader;
import java.io.InputStreamReader;
import java.lang.reflect.Field;
import weka.classifiers.trees.J48;
import weka.classifiers.trees.j48.C45Split;
import weka.classifiers.trees.j48.ClassifierSplitModel;
import weka.classifiers.trees.j48.ClassifierTree;
import weka.core.Instances;
import weka.core.Utils;

/**
 * Prints J48's trees, one JVM for all of them.
 *
 * Each input line is "ARFF-file<TAB>options". For each, one output line: the tree in preorder, a
 * node being "attribute:splitPoint:sons" or "leaf", then "|", then the class probabilities of
 * each row of the file, all separated by blanks. The class is the last attribute.
 */
public class J48Trees {
  private static Object read(Class<?> owner, Object object, String name) throws Exception {
    Field field = owner.getDeclaredField(name);
    field.setAccessible(true);
    return field.get(object);
  }

  private static void print(ClassifierTree tree, StringBuilder out) throws Exception {
    ClassifierSplitModel model =
        (ClassifierSplitModel) read(ClassifierTree.class, tree, "m_localModel");
    if ((Boolean) read(ClassifierTree.class, tree, "m_isLeaf")) {
      out.append("leaf ");
      return;
    }
    ClassifierTree[] sons = (ClassifierTree[]) read(ClassifierTree.class, tree, "m_sons");
    C45Split split = (C45Split) model;
    out.append(split.attIndex()).append(':');
    out.append(read(C45Split.class, split, "m_splitPoint")).append(':');
    out.append(sons.length).append(' ');
    for (ClassifierTree son : sons) {
      print(son, out);
    }
  }

  public static void main(String[] arguments) throws Exception {
    BufferedReader input = new BufferedReader(new InputStreamReader(System.in));
    for (String line = input.readLine(); line != null; line = input.readLine()) {
      String[] parts = line.split("\t");
      Instances data = new Instances(new BufferedReader(new FileReader(parts[0])));
      data.setClassIndex(data.numAttributes() - 1);
      J48 learner = new J48();
      learner.setOptions(Utils.splitOptions(parts[1]));
      learner.buildClassifier(data);
      StringBuilder out = new StringBuilder();
      print((ClassifierTree) read(J48.class, learner, "m_root"), out);
      out.append("|");
      for (int i = 0; i < data.numInstances(); i++) {
        for (double share : learner.distributionForInstance(data.instance(i))) {
          out.append(' ').append(share);
        }
      }
      System.out.println(out);
    }
  }
}
